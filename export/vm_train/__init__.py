"""Training and evaluation of networks: the programs vm-train and vm-evaluate."""
