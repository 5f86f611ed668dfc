"""The entry points of all programs."""
