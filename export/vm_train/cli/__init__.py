"""The commands vm-train and vm-evaluate."""
