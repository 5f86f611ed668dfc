"""What the node needs of ROS 2: subscriptions, publishers and message classes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from vm_embedded.errors import InputError, install_extra

SENSOR, TRANSFORMS, FIXED_TRANSFORMS, DETECTIONS = "sensor", "transforms", "fixed transforms", "detections"
"""Kinds of topics, for the quality of service that ROS uses: images and lenses; tf and poses; tf_static; what vm-ros
publishes."""


class Publisher(Protocol):
    """Publishes the messages of one topic."""

    def publish(self, message: Any) -> None:
        """Send a message; one that can't be sent in time is lost."""

    @property
    def readers(self) -> int:
        """Number of subscriptions."""


class Middleware(Protocol):
    """A connection to ROS 2.

    types: its message classes by their short names, and the functions octets(bytes) and doubles(numbers), which make
    the arrays of messages.
    """

    types: Any

    def subscribe(self, topic: str, message: str, take: Callable[[Any], None], kind: str = SENSOR) -> None:
        """Have `take` called, in another thread, with each message of a topic. message: its short name."""

    def publisher(self, topic: str, message: str, kind: str = DETECTIONS) -> Publisher:
        """A publisher of messages with a short name."""

    def start(self) -> None:
        """Begin to receive."""

    def close(self) -> None:
        """Disconnect."""


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
