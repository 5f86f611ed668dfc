"""What the programs of the workstation share: stopping, worker processes, progress and plots."""
