"""The commands vm-detect, vm-bench and vm-doctor."""
