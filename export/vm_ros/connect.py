"""Choose the connection to ROS 2: rclpy or cyclonedds."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

from vm_embedded.errors import InputError, install_extra

from .middleware import Middleware


def connect(name: str, ros_arguments: Sequence[str] = (), kind: str = "auto") -> Middleware:
    """Connect a node with a name.

    ros_arguments: those behind --ros-args, only for rclpy. kind: rclpy, cyclonedds, or auto: rclpy where ROS is
    sourced, otherwise cyclonedds. Raises InputError if the one needed is not installed.
    """
    if kind == "auto":  # rclpy from wheels comes without tf2_msgs and vision_msgs
        sourced = find_spec("tf2_msgs") or ros_arguments or not find_spec("cyclonedds")
        kind = "rclpy" if sourced and find_spec("rclpy") else "cyclonedds"
    try:
        if kind == "rclpy":
            from .rclpy_middleware import RclpyMiddleware

            return RclpyMiddleware(name, ros_arguments)
        from .dds_middleware import DdsMiddleware
    except ImportError as error:
        raise InputError(
            f"vm-ros needs ROS 2 (source its setup.bash) or the package cyclonedds ({error}); {install_extra('ros')}"
        ) from error
    if ros_arguments:
        raise InputError("--ros-args works only with rclpy: source ROS 2, or give the options of vm-ros instead")
    return DdsMiddleware()
