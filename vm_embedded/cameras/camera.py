"""The camera protocol: shots, errors and settings that all live cameras share.

The kinds of cameras: devices and streams through OpenCV (opencv.py), Motion JPEG (mjpeg.py) and single images over HTTP
(snapshots.py), a drawn field (synthetic.py), and another camera with scripted faults (fault.py). open_camera.py chooses
among them, and plays files at their own rate.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from ..arrays import Image
from ..config.entries import check_entries, file_name, number, switch, text_line
from ..errors import VisualMeshError
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from .image_header import MAX_MEGAPIXELS

EARLY = 0.005
"""How far in the future a frame's time may be [s]: the two clocks are read one after the other."""


_DIGITS = 9
"""Most digits of a camera's number: OpenCV takes one of 32 bits."""


class CameraError(VisualMeshError):
    """A camera that can't be opened or has disappeared. Opening it again may help."""


class BrokenFrameError(VisualMeshError):
    """A frame that can't be used. The next frame may be good."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One frame of a live camera.

    image: BGR, or the camera's own channels if the pixel format is another. captured: when the frame was taken, in
    monotonic time [s]. encoded: the JPEG that the camera sent, if it did. orientation, lens: of the camera, if the
    source knows them. truth: what a synthetic camera knows about its scene. arrived: when the frame arrived, in
    monotonic time [s]; the grabber sets it. topic: of ROS, if the frame came from one.
    """

    image: Image
    captured: float
    encoded: bytes | None = None
    orientation: Orientation | None = None
    lens: Lens | None = None
    truth: dict[str, Any] = field(default_factory=dict)
    arrived: float = 0.0
    topic: str = ""


class Camera(Protocol):
    """An open camera. The thread that opens it also reads and closes it."""

    def read(self) -> Shot | None:
        """Return the next shot, or None at the end. Raises BrokenFrameError or CameraError."""

    def close(self) -> None:
        """Release the device, connection or file."""


@dataclass(frozen=True, kw_only=True)
class CameraSettings:
    """Section [camera]: the source, what to request from a device, and when the camera counts as lost."""

    source: str = file_name(
        "",
        "camera number, /dev/videoN or /dev/v4l/by-id/...; http, https or rtsp address; gstreamer:PIPELINE; video file "
        "or folder of images, played at their frame rate; synthetic; ros, for vm-ros only",
    )
    pixel_format: str = text_line("", "FOURCC to request from a device, such as MJPG or YUYV; empty: the device's own")
    width: int = number(0, "width to request from a device; 0: the device's own", "px", (0, 20000))
    height: int = number(0, "height to request from a device; 0: the device's own", "px", (0, 20000))
    fps: float = number(
        0.0,
        "frame rate to request from a device; for files, the rate at which --live plays them and --track counts time; "
        "0: the device's or file's own",
        "1/s",
        (0, 1000),
    )
    exposure_ms: float = number(0.0, "exposure time of a device; 0: automatic", "ms", (0, 1000))
    gain: float = number(-1.0, "gain of a device, in its own units; -1: the device decides", "", (-1, 100000))
    latency_ms: float = number(
        0.0, "time from exposure to arrival, for cameras that report no capture time", "ms", (0, 1000)
    )
    loop: bool = switch(False, "restart files at their end")
    max_megapixels: float = number(
        MAX_MEGAPIXELS,
        "larger images, of a camera or a file, are not decoded; larger frames of videos and streams are rejected",
        "Mpx",
        (0.01, 1000),
    )
    max_age_ms: float = number(250.0, "frames older than this are not reported", "ms", (1, 10000))
    lost_ms: float = number(
        1000.0, "time without a new frame after which the camera is lost and opened again", "ms", (50, 60000)
    )
    open_ms: float = number(10000.0, "longest time to wait for a camera to open", "ms", (100, 60000))
    retry_ms: float = number(
        200.0, "pause before the camera is opened again; it doubles with each attempt", "ms", (10, 60000)
    )
    longest_retry_ms: float = number(5000.0, "longest pause between attempts", "ms", (10, 600000))
    frozen: bool = switch(True, "ignore a frame identical to the one before; real cameras have noise")

    def __post_init__(self) -> None:
        check_entries(self)


def camera_number(source: str) -> int | None:
    """The number of a device, as in /dev/videoN; None for any other source."""
    return int(source) if source.isascii() and source.isdigit() and len(source) <= _DIGITS else None
