"""Where detections go: messages, files, sockets, overlays and recordings."""
