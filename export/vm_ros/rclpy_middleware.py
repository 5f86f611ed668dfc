"""The connection to ROS 2 through rclpy, where ROS is sourced."""

from __future__ import annotations

import os
import threading
from array import array
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from vm_embedded.cameras.ros.message_fields import FIELDS
from vm_embedded.errors import InputError

from .middleware import DETECTIONS, FIXED_TRANSFORMS, POSES, SENSOR, TRANSFORMS

_PROFILES = {
    SENSOR: QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
    POSES: QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT),
    TRANSFORMS: QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE),
    FIXED_TRANSFORMS: QoSProfile(
        depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    ),
    DETECTIONS: QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE),
}


class RclpyPublisher:
    """A publisher of rclpy."""

    def __init__(self, publisher: Any) -> None:
        self.publish = publisher.publish
        self._publisher = publisher

    @property
    def readers(self) -> int:
        """Number of subscriptions."""
        return int(self._publisher.get_subscription_count())


class RclpyMiddleware:
    """A node of rclpy, which a thread spins. Raises InputError if ROS lacks a package of messages."""

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.types: Any = _message_classes()
        # The daemon handles signals.
        rclpy.init(args=["--ros-args", *arguments], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(name)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)

    def subscribe(self, topic: str, message: str, take: Callable[[Any], None], kind: str = SENSOR) -> None:
        """Have `take` called with each message of a topic."""
        self._node.create_subscription(getattr(self.types, message), topic, take, _PROFILES[kind])

    def publisher(self, topic: str, message: str, kind: str = DETECTIONS) -> RclpyPublisher:
        """A publisher of messages with a short name."""
        return RclpyPublisher(self._node.create_publisher(getattr(self.types, message), topic, _PROFILES[kind]))

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def close(self) -> None:
        """Stop the thread and destroy the node."""
        self._executor.shutdown()
        if self._thread.is_alive():
            self._thread.join(1.0)
        self._node.destroy_node()
        rclpy.try_shutdown()


def _message_classes() -> SimpleNamespace:
    """The classes of all messages. Raises InputError for a package that is not installed."""
    classes = {}
    for package, _, name in (full.split("/") for full in FIELDS):
        try:
            module = import_module(f"{package}.msg")
        except ImportError as error:
            distribution = os.environ.get("ROS_DISTRO", "$ROS_DISTRO")
            needed = f"ros-{distribution}-{package.replace('_', '-')}"
            raise InputError(f"ROS lacks the package {package}; run: sudo apt install {needed}") from error
        classes[name] = getattr(module, name)
    return SimpleNamespace(**classes, octets=lambda content: array("B", content), doubles=list)
