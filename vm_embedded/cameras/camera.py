"""What a live camera is: something that gives one shot after another, until it doesn't.

Which kinds there are: devices and streams through OpenCV (camera_opencv.py), MJPEG over HTTP (camera_mjpeg.py), files
played at their own rate (camera_files.py), a drawn field (camera_synthetic.py), and faults on purpose
(camera_fault.py).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..arrays import Image
from ..config.entries import check_entries, number, switch, words
from ..errors import InputError, VisualMeshError
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from .decoding import decode


class CameraError(VisualMeshError):
    """A camera that can't be opened, or that went away. Another try may help."""


class BrokenFrameError(VisualMeshError):
    """A frame that can't be used. The next one may be better."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One frame of a live camera.

    image: BGR, or as the camera gives it if the pixel format is another. captured: when it was taken, in seconds of
    the monotonic clock. encoded: the JPEG that it came as. orientation, lens: of the camera, if it knows its own.
    truth: what a drawn camera knows besides. arrived: when it was there to be taken, as whoever reads the camera notes
    in the same clock [s].
    """

    image: Image
    captured: float
    encoded: bytes | None = None
    orientation: Orientation | None = None
    lens: Lens | None = None
    truth: dict[str, Any] = field(default_factory=dict)
    arrived: float = 0.0


class Camera(Protocol):
    """An open camera. It is read and closed in the thread that opened it."""

    def read(self) -> Shot | None:
        """The next shot; None at the end. Raises BrokenFrameError or CameraError."""

    def close(self) -> None:
        """Give back what it holds."""


@dataclass(frozen=True, kw_only=True)
class CameraSettings:
    """Section [camera]: which camera, what is asked of it, and when it counts as lost."""

    source: str = words(
        "",
        "number, /dev/videoN or /dev/v4l/by-id/...; http, https or rtsp address; gstreamer:PIPELINE; video file or "
        "folder of images, played at their rate; synthetic; fault:SCRIPT",
    )
    pixel_format: str = words("", "FOURCC that a device is asked for, as MJPG or YUYV; nothing leaves its own")
    width: int = number(0, "width that a device is asked for; 0 leaves its own", "px", (0, 20000))
    height: int = number(0, "height that a device is asked for; 0 leaves its own", "px", (0, 20000))
    fps: float = number(
        0.0, "frames a second that a device is asked for, or files are played at; 0: its own", "", (0, 1000)
    )
    exposure_ms: float = number(0.0, "exposure of a device; 0: automatic", "ms", (0, 1000))
    gain: float = number(-1.0, "gain of a device, in its own units; -1 leaves its own", "", (-1, 100000))
    latency_ms: float = number(0.0, "from exposure to arrival, where a device doesn't tell", "ms", (0, 1000))
    loop: bool = switch(False, "begin files again at their end")
    max_age_ms: float = number(250.0, "frames older than this are not reported", "ms", (1, 10000))
    lost_ms: float = number(
        1000.0, "time without a new frame after which the camera is lost and opened again", "ms", (50, 60000)
    )
    open_ms: float = number(10000.0, "time that opening a camera may take", "ms", (100, 60000))
    retry_ms: float = number(200.0, "pause before the first try to open it again; doubled with each", "ms", (10, 60000))
    longest_retry_ms: float = number(5000.0, "longest pause between tries", "ms", (10, 600000))
    frozen: bool = switch(True, "count a frame that equals the one before as none at all: a camera has noise")

    def __post_init__(self) -> None:
        check_entries(self)


def named(source: str) -> str:
    """A source as it may be shown: without the password that an address may have."""
    return re.sub(r"//[^/@]*@", "//", source)


def decode_frame(content: bytes, raw: bool = False) -> Image:
    """A picture that a camera sent. Raises BrokenFrameError for one that is cut short or none."""
    try:
        return decode(content, raw)
    except InputError as error:
        raise BrokenFrameError(f"picture of {len(content)} bytes {error}") from error


def same_image(one: Image, other: Image) -> bool:
    """Whether two frames are equal to the last bit. Every sixteenth row is looked at, which noise never spares."""
    return one.shape == other.shape and bool(np.array_equal(one[::16], other[::16]))
