"""vm-ros: the detector as a node of ROS 2, with rclpy where ROS is sourced, and with cyclonedds elsewhere."""
