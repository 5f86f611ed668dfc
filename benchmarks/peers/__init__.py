"""Detectors to compare with: their networks, times and accuracy."""
