"""ROS 2: its messages as frames, lenses, poses and detections, and bags. It imports no ROS package."""
