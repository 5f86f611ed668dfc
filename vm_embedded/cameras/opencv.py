"""Read cameras through OpenCV: V4L2 devices, RTSP and other streams, GStreamer pipelines."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# OpenCV's default waits ten seconds for a frame; a lost camera should show earlier. Set before cv2 is imported.
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")

import cv2
import numpy as np

from ..borders.credentials import password_hint, without_password
from ..borders.opencv_text import open_capture
from ..errors import InputError
from ..files import exists
from .camera import EARLY, BrokenFrameError, CameraError, CameraSettings, Shot, camera_number
from .decoding import decode_frame
from .frame_clock import FrameClock
from .video_size import check_frame, check_video

_OLDEST = 1.0
"""Largest age of a device's own timestamp that is trusted [s]."""

_FFMPEG_OPTIONS = "OPENCV_FFMPEG_CAPTURE_OPTIONS"

_STREAMS = (
    "rtsp,rtp,mpegts,mpjpeg,mjpeg,jpeg_pipe,flv,live_flv,matroska,webm,mov,mp4,avi,asf,ogg,nut,mpeg,"
    "h264,hevc,m4v,mpegvideo,av1,obu,ivf"
)
"""Formats of FFmpeg that contain the stream itself. Others, such as HLS, DASH and SDP, name further addresses."""


@contextmanager
def _ffmpeg_options() -> Iterator[None]:
    """FFmpeg opens no other address than the camera's, unless the environment has options for it already."""
    given = os.environ.get(_FFMPEG_OPTIONS)
    if given is None:
        os.environ[_FFMPEG_OPTIONS] = f"rtsp_transport;tcp|max_redirects;0|format_whitelist;{_STREAMS}"
    try:
        yield
    finally:
        if given is None:
            os.environ.pop(_FFMPEG_OPTIONS, None)


class OpenCvCamera:
    """A camera that OpenCV reads. Raises CameraError if OpenCV can't open it."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._device = device_path(settings.source)
        self._clock = FrameClock()
        self._last = -np.inf  # the last timestamp that was trusted
        source = settings.source
        if self._device is not None:
            if not exists(self._device):
                raise CameraError(f"there is no camera at {self._device}")
            self._capture = open_capture(self._device.resolve(), cv2.CAP_V4L2)
        elif source.startswith("gstreamer:"):
            self._capture = open_capture(source.removeprefix("gstreamer:"), cv2.CAP_GSTREAMER)
        else:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, int(settings.open_ms)]
            limits += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, int(settings.lost_ms)]
            # By default, FFmpeg decodes on all cores, and each further thread holds back another frame.
            limits += [cv2.CAP_PROP_N_THREADS, 1]
            self._clock = FrameClock(time.monotonic())  # FFmpeg lets frames wait until it knows the stream
            with _ffmpeg_options():
                self._capture = open_capture(source, cv2.CAP_FFMPEG, limits)
        if not self._capture.isOpened():
            self._capture.release()
            raise CameraError(f"can't open camera {without_password(source)}{password_hint(source)}")
        self._motion_jpeg = self._device is not None and self._configure()
        try:
            check_video(self._capture, settings.max_megapixels)
        except InputError as error:
            self._capture.release()
            raise CameraError(f"camera {without_password(source)} {error}") from error

    def _configure(self) -> bool:
        """Request the configured settings from the device; return whether it delivers undecoded JPEGs."""
        settings, capture = self.settings, self._capture
        if settings.pixel_format:
            capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*settings.pixel_format))
        for name, value in ((cv2.CAP_PROP_FRAME_WIDTH, settings.width), (cv2.CAP_PROP_FRAME_HEIGHT, settings.height)):
            if value:
                capture.set(name, value)
        if settings.fps:
            capture.set(cv2.CAP_PROP_FPS, settings.fps)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if settings.exposure_ms:
            capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)  # V4L2_EXPOSURE_MANUAL
            capture.set(cv2.CAP_PROP_EXPOSURE, round(10.0 * settings.exposure_ms))  # in units of 100 us
        if settings.gain >= 0.0:
            capture.set(cv2.CAP_PROP_GAIN, settings.gain)
        fourcc = int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little")
        # decode_frame decodes JPEGs instead of OpenCV, which accepts half a JPEG as a whole image.
        return fourcc in (b"MJPG", b"JPEG") and bool(capture.set(cv2.CAP_PROP_CONVERT_RGB, 0))

    def read(self) -> Shot:
        """Return the next shot. Raises CameraError if there is none, BrokenFrameError if it is cut short."""
        good, image = self._capture.read()
        arrived = time.monotonic()
        if not good or image is None:
            raise CameraError(f"camera {without_password(self.settings.source)} delivers no frames")
        if self._device is not None and not exists(self._device):
            # Some drivers repeat the last frame after the camera was unplugged.
            raise CameraError(f"camera {self._device} was unplugged")
        captured = self._captured(arrived)
        if self._motion_jpeg:
            content = image.tobytes()
            return Shot(decode_frame(content, self._raw, self.settings.max_megapixels), captured, content)
        if image.dtype != np.uint8 or image.size == 0:
            raise BrokenFrameError(f"frame has {image.dtype} values of shape {image.shape}, not an 8-bit image")
        frame = np.asarray(image, dtype=np.uint8)
        try:
            check_frame(frame, self.settings.max_megapixels)
        except InputError as error:
            raise BrokenFrameError(f"frame {error}") from error
        return Shot(frame, captured)

    def _captured(self, arrived: float) -> float:
        """When the frame was taken, in monotonic time [s]: V4L2's timestamp if it is plausible, else what the
        arrivals tell, less the configured latency."""
        stamp = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC) if self._device is not None else -np.inf
        trusted = arrived - _OLDEST < stamp < arrived + EARLY and stamp > self._last
        self._last = max(self._last, stamp) if trusted else self._last
        taken = self._clock.taken(arrived)
        return float(min(stamp, arrived)) if trusted else taken - 1e-3 * self.settings.latency_ms

    def close(self) -> None:
        """Release the device or stream."""
        self._capture.release()


def device_path(source: str) -> Path | None:
    """The path of a V4L2 device given by number or path; None for any other source."""
    number = camera_number(source)
    if number is not None:
        return Path(f"/dev/video{number}")
    return Path(source) if source.startswith("/dev/") else None


def _check_can_be_found(device: Path) -> None:
    """Raise InputError for a path that is too long or that this user may not look at; it may be missing yet."""
    try:
        device.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise InputError(f"can't open camera {device}: {error.strerror}") from error


def check_opencv_settings(settings: CameraSettings) -> None:
    """Raise InputError for settings that OpenCV can never use."""
    if settings.pixel_format and (len(settings.pixel_format) != 4 or not settings.pixel_format.isascii()):
        raise InputError(f"pixel_format must be four letters such as MJPG, not {settings.pixel_format!r}")
    device = device_path(settings.source)
    if device is not None:
        _check_can_be_found(device)
    if settings.source.startswith("gstreamer:"):
        registry = cv2.videoio_registry  # lists backends that this OpenCV lacks, too
        backends = [registry.getBackendName(each) for each in registry.getBackends() if registry.hasBackend(each)]
        if "GSTREAMER" not in backends:
            raise InputError(f"this OpenCV was built without GStreamer (it has {', '.join(backends)})")
