"""Choose the connection to ROS 2: rclpy where ROS is sourced, otherwise cyclonedds."""

from __future__ import annotations

from collections.abc import Sequence

from vm_embedded.errors import InputError, install_extra

from .middleware import Middleware


def connect(name: str, ros_arguments: Sequence[str] = ()) -> Middleware:
    """Connect a node with a name: with rclpy where ROS is sourced, otherwise with cyclonedds.

    ros_arguments: those behind --ros-args, only for rclpy. Raises InputError if neither is installed.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError:
        pass
    else:
        from .rclpy_middleware import RclpyMiddleware

        return RclpyMiddleware(name, ros_arguments)
    try:
        from .dds_middleware import DdsMiddleware
    except ImportError as error:
        raise InputError(
            f"vm-ros needs ROS 2 (source its setup.bash) or the package cyclonedds ({error}); {install_extra('ros')}"
        ) from error
    if ros_arguments:
        raise InputError("--ros-args works only where ROS 2 is sourced; give the options of vm-ros instead")
    return DdsMiddleware()
