"""Frames of ROS 2: images, lenses and poses of its messages, and bags. It imports no package of ROS."""
