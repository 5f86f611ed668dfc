"""Output of detections: messages, channels, files of results and boxes, recordings, and messages of ROS."""
