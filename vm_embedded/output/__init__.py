"""Output of detections: messages, channels, result files, overlays and recordings."""
