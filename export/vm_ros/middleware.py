"""What the node needs of ROS 2: subscriptions, publishers and message classes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

SENSOR, POSES, TRANSFORMS, FIXED_TRANSFORMS, DETECTIONS = "sensor", "poses", "tf", "tf_static", "detections"
"""Kinds of topics, for the quality of service that ROS uses: images and lenses; poses; tf; tf_static; what vm-ros
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

    types: its message classes by their short names, as far as their packages are installed, and the functions
    octets(bytes) and doubles(numbers), which make the arrays of messages. parameters: those of the node, by their
    names. remark: what is left out, and what helps; empty if nothing is.
    """

    types: Any
    parameters: Mapping[str, Any]
    remark: str

    def subscribe(self, topic: str, message: str, take: Callable[[Any], None], kind: str = SENSOR) -> None:
        """Have `take` called, in another thread, with each message of a topic. message: its short name."""

    def publisher(self, topic: str, message: str, kind: str = DETECTIONS) -> Publisher:
        """A publisher of messages with a short name."""

    def start(self) -> None:
        """Begin to receive."""

    def close(self) -> None:
        """Disconnect."""
