"""Choose the kind of camera from the name of its source."""

from __future__ import annotations

import glob
import http.client
import time
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from pathlib import Path

from ..borders.credentials import without_password
from ..borders.opencv_text import check_address
from ..errors import InputError, one_line, unknown
from ..files import exists, is_file, there
from ..geometry.lens_files import read_lens_file
from .camera import BrokenFrameError, Camera, CameraError, CameraSettings, Shot
from .decoding import decode_frame
from .frame_source import Frame
from .http_get import HttpGet, parse_url
from .image_files import lens_beside, open_source
from .mjpeg import MjpegCamera, NotMotionJpegError
from .opencv import OpenCvCamera, check_opencv_settings, device_path
from .synthetic import SyntheticCamera, parse_motion

ROS = "ros"
"""Source of the images of a ROS topic, which vm-ros opens."""

_PROTOCOLS = ("http", "https", "rtsp", "rtsps", "rtmp", "rtmps", "rtp", "srt", "tcp", "udp", "file")
"""Usual protocols of addresses; OpenCV's backends know more."""

Opener = Callable[[], Camera]
"""Opens a camera. Raises CameraError if that fails now but may succeed later."""


def _is_path(source: str) -> bool:
    """Whether a source that looks like an address is a file or folder whose name has a colon."""
    return ":" in source and device_path(source) is None and exists(there(Path(source)))


def is_live(source: str) -> bool:
    """Whether a source is always a live camera: not a file, which vm-detect may also process frame by frame."""
    prefix = source.partition(":")[0]
    node = device_path(source)
    return not _is_path(source) and (
        prefix in ("synthetic", "gstreamer", ROS) or "://" in source or (node is not None and not is_file(node))
    )


def brings_lens_and_pose(source: str) -> bool:
    """Whether the camera of a live source needs no configured lens and pose: its shots bring them."""
    return source.partition(":")[0] in ("synthetic", ROS) and not _is_path(source)


def camera_opener(settings: CameraSettings, raw: bool = False) -> Opener:
    """Return a function that opens the configured camera; it may be called again and again.

    raw: images keep their own channels. Raises InputError for a source or setting that can never work.
    """
    source = settings.source
    if _is_path(source):
        return lambda: FileCamera(settings, raw)
    if source == ROS:
        raise InputError("camera ros, a topic of ROS, works only with vm-ros")
    if source.partition(":")[0] == "synthetic":
        parse_motion(source)
        if raw:
            raise InputError("the synthetic camera supports only --format bgr")
        return lambda: SyntheticCamera(settings)
    if "://" in source or source.startswith("gstreamer:"):
        check_address(source)
    if source.startswith(("http://", "https://")):
        parse_url(source)
        return lambda: _network_camera(settings, raw)
    if device_path(source) is not None or source.startswith("gstreamer:") or "://" in source:
        _check_protocol(source)
        check_opencv_settings(settings)
        if raw and device_path(source) is None and not source.startswith("gstreamer:"):
            raise InputError(f"camera {without_password(source)} delivers colors: it supports only --format bgr")
        return lambda: OpenCvCamera(settings, raw)
    if not exists(there(Path(source))) and not glob.glob(source, recursive=True):  # noqa: PTH207 (as in image_files.py)
        raise InputError(
            f"no such camera: {without_password(source)!r}; give a device, an address, an existing file or folder, "
            "a pattern of images, synthetic or gstreamer:PIPELINE"
        )
    return lambda: FileCamera(settings, raw)


def _check_protocol(source: str) -> None:
    """Raise InputError for an address whose protocol looks like a mistyped one."""
    protocol, slashes, _ = source.partition("://")
    if slashes and protocol not in _PROTOCOLS and get_close_matches(protocol, _PROTOCOLS, n=1):
        raise InputError(unknown("protocol", protocol, _PROTOCOLS))


def _network_camera(settings: CameraSettings, raw: bool) -> Camera:
    """A Motion JPEG stream, single images, or any other stream that OpenCV reads from the address."""
    try:
        return MjpegCamera(settings, raw)
    except NotMotionJpegError as error:
        return SnapshotCamera(settings, raw) if error.kind.startswith("image/") else OpenCvCamera(settings, raw)


_RATE = 10.0
"""Requests per second if the settings have no frame rate [1/s]."""

_LARGEST = 64 * 2**20
"""Largest size of an image [bytes]."""


class SnapshotCamera:
    """A camera whose address responds with one image. It is asked at the configured frame rate."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._due = time.monotonic()

    def read(self) -> Shot:
        """Return the next shot, when it is due. Raises CameraError, and BrokenFrameError for a bad image."""
        time.sleep(max(self._due - time.monotonic(), 0.0))
        self._due = max(self._due, time.monotonic() - 1.0 / _RATE) + 1.0 / (self.settings.fps or _RATE)
        name, seconds = without_password(self.settings.source), 1e-3 * self.settings.lost_ms
        get = HttpGet(self.settings.source, seconds)
        try:
            content = get.response.read(_LARGEST + 1)
        except (OSError, ValueError, OverflowError, http.client.HTTPException) as error:
            raise CameraError(f"{name}: {one_line(error)}") from error
        finally:
            get.close()
        captured = time.monotonic() - 1e-3 * self.settings.latency_ms
        return Shot(decode_frame(content[:_LARGEST], self._raw, self.settings.max_megapixels), captured, content)

    def close(self) -> None:
        """Nothing stays open between two images."""


RATE = 30.0
"""Frame rate of files without their own [1/s]."""


class FileCamera:
    """Plays the frames that image_files.py reads. Raises CameraError if the source can't be opened."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._frames = self._open()
        self._due = time.monotonic()

    def _open(self) -> Iterator[Frame]:
        try:
            source = open_source(self.settings.source, self._raw, self.settings.max_megapixels)
        except InputError as error:
            raise CameraError(str(error)) from error
        self._period = 1.0 / (self.settings.fps or source.rate or RATE)
        return source.frames

    def read(self) -> Shot | None:
        """Return the next shot when it is due. Raises BrokenFrameError for an image that can't be read."""
        self._due = max(self._due + self._period, time.monotonic() - self._period)
        time.sleep(max(self._due - time.monotonic(), 0.0))
        frame = next(self._frames, None)
        if frame is None and self.settings.loop:
            self._frames = self._open()
            frame = next(self._frames, None)
        if frame is None:
            return None
        try:
            beside = lens_beside(frame.path)
            if beside is None:
                return Shot(frame.read(), self._due)
            file = read_lens_file(beside)
            return Shot(frame.read(), self._due, orientation=file.orientation, lens=file.lens)
        except InputError as error:
            raise BrokenFrameError(str(error)) from error

    def close(self) -> None:
        """Release the file."""
        self._frames = iter(())
