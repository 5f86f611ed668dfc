"""What connects the daemon to other robot software."""

from __future__ import annotations

from typing import Protocol

from ..cameras.camera import CameraSettings
from ..cameras.open_camera import Opener
from ..output.messages import Message
from ..poses.stream import PoseStream
from .answering import Answer


class Bridge(Protocol):
    """Connects the daemon to other robot software, such as ROS: it may open the camera, and gets every message."""

    def opener(self, settings: CameraSettings, raw: bool) -> Opener:
        """Return a function that opens the camera, as `camera_opener` does."""

    async def open(self, poses: PoseStream) -> None:
        """Connect; from now on, poses may go to `poses`. Raises InputError."""

    def publish(self, message: Message, answer: Answer | None) -> None:
        """Publish a message. answer: that of its frame; None for a message with a state only."""

    async def close(self) -> None:
        """Disconnect."""
