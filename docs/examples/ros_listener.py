"""Print where vm-ros sees balls, and its state: a node of ROS 2 that also runs without ROS.

vm-ros --camera synthetic &
python docs/examples/ros_listener.py 10     (seconds; without a number it does not end)

It uses rclpy if ROS is sourced, otherwise the package cyclonedds. With rclpy alone, subscribe to the same topics:
/vm_ros/detections_3d is a vision_msgs/Detection3DArray, /diagnostics a diagnostic_msgs/DiagnosticArray.
"""

import sys
import time

from vm_ros.cli import connect


def show_objects(message) -> None:
    """Print the place of each object, in the frame of the message: x forward and y to the left [m]."""
    for each in message.detections:
        (best,) = each.results
        place = best.pose.pose.position
        print(
            f"{best.hypothesis.class_id} at ({place.x:.2f}, {place.y:.2f}) m in {message.header.frame_id}", flush=True
        )


def show_state(message) -> None:
    """Print the state of the detector. A lost camera shows here, and never as a message without objects."""
    for each in message.status:
        print(f"state: {each.message}", flush=True)


def main(seconds: float) -> None:
    """Listen for some seconds."""
    node = connect("listener")
    node.subscribe("/vm_ros/detections_3d", "Detection3DArray", show_objects)
    node.subscribe("/diagnostics", "DiagnosticArray", show_state)
    node.start()
    try:
        time.sleep(seconds)
    finally:
        node.close()


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else float("inf"))
