"""Cameras through OpenCV: V4L2 devices, RTSP and other streams, GStreamer pipelines."""

from __future__ import annotations

import os
import time
from pathlib import Path

# Waiting for a frame longer than this is done by whoever reads; OpenCV's own limit is ten seconds.
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")

import cv2
import numpy as np

from ..errors import InputError
from .camera import BrokenFrameError, CameraError, CameraSettings, Shot, decode_frame, named

_OLDEST = 1.0
"""Seconds that a frame's own time may lie back to be believed."""

_EARLY = 0.005
"""Seconds that it may lie ahead: clocks are read one after the other."""


class OpenCvCamera:
    """A camera that OpenCV reads. Raises CameraError if it can't be opened."""

    def __init__(self, settings: CameraSettings, raw: bool = False) -> None:
        self.settings = settings
        self._raw = raw
        self._device = device_of(settings.source)
        self._last = -np.inf
        source = settings.source
        if self._device is not None:
            if not self._device.exists():
                raise CameraError(f"there is no camera {self._device}")
            self._capture = cv2.VideoCapture(str(self._device.resolve()), cv2.CAP_V4L2)
        elif source.startswith("gstreamer:"):
            self._capture = cv2.VideoCapture(source.removeprefix("gstreamer:"), cv2.CAP_GSTREAMER)
        else:
            limits = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, int(settings.open_ms)]
            limits += [cv2.CAP_PROP_READ_TIMEOUT_MSEC, int(settings.lost_ms)]
            self._capture = cv2.VideoCapture(source, cv2.CAP_FFMPEG, limits)
        if not self._capture.isOpened():
            self._capture.release()
            raise CameraError(f"can't open camera {named(source)}")
        self._motion_jpeg = self._device is not None and self._configure()

    def _configure(self) -> bool:
        """Ask the device for what is configured; whether it gives JPEGs as they come."""
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
            capture.set(cv2.CAP_PROP_EXPOSURE, round(10.0 * settings.exposure_ms))  # V4L2 counts in 100 us
        if settings.gain >= 0.0:
            capture.set(cv2.CAP_PROP_GAIN, settings.gain)
        fourcc = int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little")
        # JPEGs are decoded here, because OpenCV takes half of one for a whole picture.
        return fourcc in (b"MJPG", b"JPEG") and bool(capture.set(cv2.CAP_PROP_CONVERT_RGB, 0))

    def read(self) -> Shot:
        """The next shot. Raises CameraError if there is none, BrokenFrameError if it is cut short."""
        good, image = self._capture.read()
        arrived = time.monotonic()
        if not good or image is None:
            raise CameraError(f"camera {named(self.settings.source)} gives no frames")
        if self._device is not None and not self._device.exists():
            # After an unplug the last frame may come again and again.
            raise CameraError(f"camera {self._device} is gone")
        captured = self._captured(arrived)
        if self._motion_jpeg:
            content = image.tobytes()
            return Shot(decode_frame(content, self._raw), captured, content)
        if image.dtype != np.uint8 or image.size == 0:
            raise BrokenFrameError(f"frame of {image.dtype} {image.shape} is no picture")
        return Shot(np.asarray(image), captured)

    def _captured(self, arrived: float) -> float:
        """When the frame was taken: V4L2 says so in monotonic time. What can't be is not believed."""
        stamp = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC) if self._device is not None else -np.inf
        believed = arrived - _OLDEST < stamp < arrived + _EARLY and stamp > self._last
        self._last = max(self._last, stamp) if believed else self._last
        return float(min(stamp, arrived)) if believed else arrived - 1e-3 * self.settings.latency_ms

    def close(self) -> None:
        """Give the device back."""
        self._capture.release()


def device_of(source: str) -> Path | None:
    """The node of a device, by number or path; None for any other source."""
    if source.isascii() and source.isdigit():
        return Path(f"/dev/video{int(source)}")
    return Path(source) if source.startswith("/dev/") else None


def check_opencv(settings: CameraSettings) -> None:
    """Raise InputError for what no camera of OpenCV can be asked."""
    if settings.pixel_format and (len(settings.pixel_format) != 4 or not settings.pixel_format.isascii()):
        raise InputError(f"pixel_format must be four letters, as MJPG, not {settings.pixel_format!r}")
    if settings.source.startswith("gstreamer:"):
        backends = [cv2.videoio_registry.getBackendName(each) for each in cv2.videoio_registry.getBackends()]
        if "GSTREAMER" not in backends:
            raise InputError(f"this OpenCV has no GStreamer (it has {', '.join(backends)})")
