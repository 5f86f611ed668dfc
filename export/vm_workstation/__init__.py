"""What the programs of the workstation share: stopping, worker processes and plots."""
