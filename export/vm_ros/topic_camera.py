"""A topic of images as a camera of the daemon."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vm_embedded.arrays import Image
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings, Shot
from vm_embedded.cameras.ros.images import image_of
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens

_MARGIN = 0.8
"""The camera fails after this part of the time after which it counts as lost: so the status is out in time."""

_OTHER_CLOCK = 10.0
"""Age of an image [s] above which its stamp must be of another clock."""


@dataclass(frozen=True, eq=False)
class RosShot(Shot):
    """A shot with the header of its message: stamp (builtin_interfaces/Time) and frame_id."""

    stamp: Any = None
    frame_id: str = ""


class Newest:
    """The newest image message of a topic, and when it was captured [s, monotonic]."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._changed = threading.Condition()
        self._newest: tuple[Any, float] | None = None

    def put(self, message: Any, captured: float) -> None:
        """Replace the newest message."""
        with self._changed:
            self._newest = message, captured
            self._changed.notify()

    def take(self, seconds: float) -> tuple[Any, float] | None:
        """The newest message if it was not taken before; otherwise wait for one up to `seconds` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._newest is not None, seconds)
            newest, self._newest = self._newest, None
        return newest


class TopicCamera:
    """Reads the images of a topic.

    lens_of_camera: returns the lens of camera_info, or None to use the configured one; raises InputError without any.
    """

    def __init__(
        self, newest: Newest, settings: CameraSettings, raw: bool, lens_of_camera: Callable[[], Lens | None]
    ) -> None:
        self._newest, self._settings, self._raw, self._lens = newest, settings, raw, lens_of_camera
        self._patience = 1e-3 * settings.open_ms  # until the first image

    def read(self) -> RosShot:
        """Return the next shot. Raises CameraError if none comes, and BrokenFrameError for one that can't be used."""
        started = time.monotonic()
        taken = self._newest.take(_MARGIN * self._patience)
        if taken is None:
            waited = time.monotonic() - started
            raise CameraError(f"no image on {self._newest.topic} for {waited:.1f} s")
        self._patience = 1e-3 * self._settings.lost_ms
        message, captured = taken
        header, age = message.header, time.monotonic() - captured
        if abs(age) > _OTHER_CLOCK:
            side = "before" if age > 0.0 else "after"
            raise BrokenFrameError(
                f"stamp of the image is {abs(age):.0f} s {side} now; if its clock is that of a bag or a simulation, "
                "give --ros-clock arrival"
            )
        try:
            image: Image = image_of(message, self._raw, self._settings.max_megapixels)
            stamp, frame_id, topic = header.stamp, header.frame_id, self._newest.topic
            return RosShot(image, captured, lens=self._lens(), topic=topic, stamp=stamp, frame_id=frame_id)
        except InputError as error:
            raise BrokenFrameError(str(error)) from error

    def close(self) -> None:
        """Do nothing: the subscription stays."""
