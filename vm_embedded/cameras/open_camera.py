"""Which camera a name means."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from .camera import Camera, CameraSettings
from .fault import FaultCamera, Faults, FaultScript
from .files import FileCamera
from .mjpeg import MjpegCamera, NoMotionJpegError, address_of
from .opencv import OpenCvCamera, check_opencv, device_of
from .synthetic import SyntheticCamera, motion_of

Opener = Callable[[], Camera]
"""Opens a camera; raises CameraError if that fails now and may work later."""


def is_live(source: str) -> bool:
    """Whether a source is a camera by nature, not a file that might be played as one."""
    prefix = source.partition(":")[0]
    node = device_of(source)
    return prefix in ("synthetic", "fault", "gstreamer") or "://" in source or (node is not None and not node.is_file())


def camera_opener(settings: CameraSettings, raw: bool = False) -> Opener:
    """What opens the configured camera, again and again.

    raw: images keep the channels that they have. Raises InputError for a name or setting that can never work.
    """
    source = settings.source
    if source.startswith("fault:"):
        script = FaultScript.read(Path(source.removeprefix("fault:")))
        faults, inner = Faults(script), camera_opener(replace(settings, source=script.source), raw)
        return lambda: FaultCamera(faults, inner)
    if source.partition(":")[0] == "synthetic":
        motion_of(source)
        if raw:
            raise InputError("a drawn camera gives bgr, and nothing else")
        return lambda: SyntheticCamera(settings)
    if source.startswith(("http://", "https://")):
        address_of(source)
        return lambda: _network_camera(settings, raw)
    if device_of(source) is not None or source.startswith("gstreamer:") or "://" in source:
        check_opencv(settings)
        return lambda: OpenCvCamera(settings, raw)
    if not Path(source).exists():
        raise InputError(
            f"no such camera: {source!r} is no device, address, file or folder, nor synthetic, fault:SCRIPT or "
            "gstreamer:PIPELINE"
        )
    return lambda: FileCamera(settings, raw)


def _network_camera(settings: CameraSettings, raw: bool) -> Camera:
    """A stream of JPEGs, or whatever else OpenCV can make of an address."""
    try:
        return MjpegCamera(settings, raw)
    except NoMotionJpegError:
        return OpenCvCamera(settings, raw)
