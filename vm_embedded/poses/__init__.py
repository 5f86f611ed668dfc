"""Camera poses as a robot sends them, buffered and interpolated."""
