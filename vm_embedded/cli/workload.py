"""The frame, lens and walk that vm-bench measures a detector on."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import Image
from ..cameras.image_files import check_read_format, read_image
from ..config.units import parse_size
from ..detection.pixel_formats import checked_image
from ..errors import InputError
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation
from ..geometry.radial_lenses import Rectilinear
from ..live.configuration import Configuration

_SIZE, _HEIGHT, _PITCH = (1280, 1024), 0.6, 0.4
"""Image size [px], height [m] and pitch [rad] of the camera where the user gives none."""

SWING, SWAY = math.radians(10.0), 0.03
"""How far a walk moves the camera: pitch and roll to both sides [rad], and the height up and down [m]."""

_FRAME_RATE, _STRIDE_RATE, _STEPS_PER_STRIDE = 30.0, 0.97, 2.02
"""Frames and strides per second, and steps per stride. The odd values keep the walk from repeating itself."""


@dataclass(frozen=True)
class Workload:
    """One image, seen through a lens from each orientation of a walk.

    middle: the orientation around which the walk swings.
    """

    image: Image
    lens: Lens
    middle: Orientation
    orientations: list[Orientation]

    @property
    def size(self) -> Size:
        """Width and height of the image [px]."""
        return self.image.shape[1], self.image.shape[0]


def make_workload(options: argparse.Namespace, given: Configuration) -> Workload:
    """The workload that the options of vm-bench describe. Raises InputError."""
    if options.frames < 1:
        raise InputError(f"--frames must be at least 1, not {options.frames}")
    middle = given.fixed_orientation() or Orientation.from_roll_pitch(_HEIGHT, 0.0, _PITCH)
    if middle.height <= SWAY:
        raise InputError(f"the walk moves a camera at {middle.height:g} m below the plane; give a larger --height")
    image, lens = _image_and_lens(options, given)
    return Workload(image, lens, middle, walk(middle, options.frames))


def walk(middle: Orientation, frames: int) -> list[Orientation]:
    """Orientations of the camera of a walking robot, 30 per second.

    The roll swings by SWING to both sides about once per second, and the pitch about twice. The height sways by SWAY
    about twice per second. The frequencies differ, so no two frames are the same.
    """
    phases = 2.0 * np.pi * _STRIDE_RATE / _FRAME_RATE * np.arange(frames)
    return [
        Orientation.from_roll_pitch(
            middle.height + SWAY * math.sin(_STEPS_PER_STRIDE * phase),
            middle.roll + SWING * math.sin(phase),
            middle.pitch + SWING * math.cos(_STEPS_PER_STRIDE * phase),
        )
        for phase in phases.tolist()
    ]


def draw_empty_field(size: Size, format: str) -> Image:
    """An image of a green field without objects: uint8 (height, width[, channels]) in a pixel format."""
    random = np.random.default_rng(0)
    field = np.full((size[1], size[0], 3), (60, 110, 50), dtype=np.uint8)
    field = np.asarray(cv2.add(field, random.integers(0, 12, field.shape, dtype=np.uint8)), dtype=np.uint8)
    if format in ("bgra", "rgba"):
        return np.dstack([field, np.full(field.shape[:2], 255, dtype=np.uint8)])
    return field if format in ("bgr", "rgb") else np.ascontiguousarray(field[:, :, 1])


def _image_and_lens(options: argparse.Namespace, given: Configuration) -> tuple[Image, Lens]:
    """The image to detect in, and its lens: the given one, or a rectilinear one with a wide view."""
    format = given.detector.format
    if options.image is None:
        own = given.lens.lens.size if given.lens is not None else None
        size = parse_size(options.size) if options.size else (own or _SIZE)
        return draw_empty_field(size, format), given.lens_for(size) or _wide_lens(size)
    if options.size is not None:
        raise InputError("--size is only for the drawn field; leave it out with --image")
    check_read_format(format)
    image = checked_image(read_image(options.image, raw=format != "bgr"), format)
    size = image.shape[1], image.shape[0]
    return image, given.lens_for(size) or _wide_lens(size)


def _wide_lens(size: Size) -> Lens:
    return Rectilinear(focal_length=0.5 * size[0], fov=2.0)
