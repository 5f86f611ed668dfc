"""What all trainings share: the folder of a run, the loop of its epochs, the optimizer, the log and the hardware."""
