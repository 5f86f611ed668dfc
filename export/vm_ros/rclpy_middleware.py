"""The connection to ROS 2 through rclpy, where ROS is sourced."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from vm_embedded.cameras.ros.message_fields import FIELDS, MESSAGES, short_name
from vm_embedded.errors import InputError, one_line

from .cdr import encode
from .middleware import DETECTIONS, FIXED_TRANSFORMS, POSES, SENSOR, TRANSFORMS
from .plain_messages import plain_classes

_PROFILES = {
    SENSOR: QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
    POSES: QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT),
    TRANSFORMS: QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE),
    FIXED_TRANSFORMS: QoSProfile(
        depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
    ),
    DETECTIONS: QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE),
}

_OWN_PARAMETERS = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares."""


class RclpyPublisher:
    """A publisher of rclpy for messages with a short name."""

    def __init__(self, publisher: Any, message: str) -> None:
        self._publisher, self._message = publisher, message

    def publish(self, message: Any) -> None:
        """Send a message."""
        self._publisher.publish(encode(self._message, message))

    @property
    def readers(self) -> int:
        """Number of subscriptions."""
        return int(self._publisher.get_subscription_count())


class RclpyMiddleware:
    """A node of rclpy, which a thread spins. Raises InputError for wrong arguments."""

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self._classes, self._missing = message_classes()
        self.types = plain_classes(self._classes)
        # The daemon handles signals.
        try:
            rclpy.init(args=["--ros-args", *arguments], signal_handler_options=SignalHandlerOptions.NO)
        except RuntimeError as error:  # also those of the bindings
            raise InputError(f"ROS rejects what stands behind --ros-args: {one_line(error)}") from error
        self._node = rclpy.create_node(name, automatically_declare_parameters_from_overrides=True)
        self.parameters: Mapping[str, Any] = {
            each: parameter.value
            for each, parameter in self._node.get_parameters_by_prefix("").items()
            if each not in _OWN_PARAMETERS and not each.startswith("qos_overrides.")
        }
        if self._node.get_parameter("use_sim_time").value:
            self.parameters = {"ros_clock": "arrival", **self.parameters}
        self.remark = (
            f"topics with messages of these packages are left out; to have them, {_install(self._missing)}"
            if self._missing
            else ""
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)

    def subscribe(self, topic: str, message: str, take: Callable[[Any], None], kind: str = SENSOR) -> None:
        """Have `take` called with each message of a topic. Raises InputError without its package."""
        self._node.create_subscription(self._class(message), topic, take, _PROFILES[kind])

    def publisher(self, topic: str, message: str, kind: str = DETECTIONS) -> RclpyPublisher:
        """A publisher of messages with a short name. Raises InputError without its package."""
        return RclpyPublisher(self._node.create_publisher(self._class(message), topic, _PROFILES[kind]), message)

    def _class(self, message: str) -> Any:
        if message not in self._classes:
            package = MESSAGES[message].split("/")[0]
            raise InputError(f"ROS lacks the messages {message}: {_install([package])}")
        return self._classes[message]

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


def message_classes() -> tuple[dict[str, Any], list[str]]:
    """The classes of all messages whose packages are installed, by short name, and the names of the other packages."""
    classes, missing = {}, set[str]()
    for full in FIELDS:
        package, _, name = full.split("/")
        try:
            classes[short_name(full)] = getattr(import_module(f"{package}.msg"), name)
        except ImportError:
            missing.add(package)
    return classes, sorted(missing)


def _install(packages: Sequence[str]) -> str:
    """How to install packages of messages."""
    distribution = os.environ.get("ROS_DISTRO", "")
    names = " ".join(f"ros-{distribution}-{each.replace('_', '-')}" for each in packages)
    return f"run: sudo apt install {names}" if distribution else f"install {', '.join(packages)}"
