"""Detections and states as messages of ROS 2, and MCAP files. It imports no package of ROS."""
