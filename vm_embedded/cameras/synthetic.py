"""A camera that is drawn: it sways over a field and turns while a ball rolls in front of it.

For trying things out without hardware. Where everything is follows from the time alone, so that whoever knows the time
knows the truth: Motion says it to demonstrations and tests.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..arrays import Floats, Image, Singles
from ..errors import InputError
from ..geometry.lens import Lens, Rectilinear, Size
from ..geometry.orientation import Orientation
from .camera import CameraSettings, Shot

SIZE = (640, 512)
RATE = 30.0
RADIUS = 0.095
"""Radius of the ball [m]."""

_FOCAL_LENGTH = 0.7  # in widths of the picture
_LINES, _LINE, _STRIPE = 3.0, 0.08, 1.4  # [m] between lines, and width of lines and of stripes in the grass
_HORIZON = -0.03  # where the field ends, upward part of a ray
_NOISE = 3.0
_SPARE = 64  # [px] that the pattern of noise is larger than the picture

_GRASS, _STRIPES, _SKY = (48.0, 118.0, 52.0), 14.0, (190.0, 170.0, 150.0)
_BALL, _PATCH, _WHITE = (235.0, 238.0, 240.0), (28.0, 26.0, 24.0), (225.0, 228.0, 225.0)

_GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0
_PATCHES: Floats = np.array(
    [each for a in (-1.0, 1.0) for b in (-_GOLDEN, _GOLDEN) for each in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))]
) / math.hypot(1.0, _GOLDEN)
"""Middles (12, 3) of the ball's black patches: corners of an icosahedron."""


@dataclass(frozen=True)
class Motion:
    """Where camera and ball are at a time [s] of the monotonic clock.

    turn [rad/s]: of the camera around the vertical.
    """

    turn: float = 0.2

    def orientation(self, time: float) -> Orientation:
        """Of the camera."""
        return Orientation.from_roll_pitch(
            height=0.8 + 0.02 * math.sin(9.0 * time),
            roll=0.04 * math.sin(4.5 * time),
            pitch=0.4 + 0.03 * math.cos(9.0 * time),
            yaw=math.remainder(self.turn * time, 2.0 * math.pi),
        )

    def ball(self, time: float) -> Floats:
        """Center (3,) of the ball [m], from the point below the camera."""
        distance = 2.0 + 0.7 * math.sin(0.9 * time)
        bearing = self.turn * time + 0.3 * math.sin(0.6 * time)
        return np.array([distance * math.cos(bearing), distance * math.sin(bearing), RADIUS])


def motion_of(source: str) -> Motion:
    """The motion of "synthetic" or "synthetic:TURN", TURN in rad/s. Raises InputError."""
    _, colon, turn = source.partition(":")
    try:
        motion = Motion(float(turn)) if colon else Motion()
    except ValueError:
        motion = Motion(math.nan)
    if not abs(motion.turn) <= 100.0:
        raise InputError(f"synthetic:TURN needs a number of rad/s from -100 to 100, not {turn!r}")
    return motion


class SyntheticCamera:
    """Draws a shot whenever one is due, with its orientation and the ball's place as truth."""

    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        self.motion = motion_of(settings.source)
        self.size: Size = (settings.width or SIZE[0], settings.height or SIZE[1])
        self.lens = lens_of(self.size)
        self._period = 1.0 / (settings.fps or RATE)
        self._due = time.monotonic()
        self._random = np.random.default_rng(0)
        self._noise = self._random.normal(0.0, 3.0, (self.size[1] + _SPARE, self.size[0] + _SPARE, 3)).astype(
            np.float32
        )

    def read(self) -> Shot:
        """The next shot, once it is due."""
        self._due = max(self._due + self._period, time.monotonic() - self._period)
        captured = self._due - 1e-3 * self.settings.latency_ms
        image = self.drawn(captured)
        time.sleep(max(self._due - time.monotonic(), 0.0))
        truth = {"ball": [round(float(each), 4) for each in self.motion.ball(captured)]}
        return Shot(image, captured, None, self.motion.orientation(captured), self.lens, truth)

    def close(self) -> None:
        """Nothing is held."""

    def drawn(self, captured: float) -> Image:
        """The picture of a moment."""
        orientation = self.motion.orientation(captured)
        image: Singles = np.asarray(cv2.resize(self._field(orientation), self.size), dtype=np.float32)
        self._draw_ball(image.reshape(-1, 3), orientation, captured)
        down, right = self._random.integers(0, _SPARE, 2)
        noise = self._noise[down : down + self.size[1], right : right + self.size[0]]
        return np.asarray(np.clip(image + noise, 0.0, 255.0), dtype=np.uint8)

    @cached_property
    def _rays(self) -> Singles:
        """Rays (height, width, 3) of the pixels in the camera's frame."""
        x, y = np.meshgrid(np.arange(self.size[0], dtype=float), np.arange(self.size[1], dtype=float))
        rays = self.lens.unproject(np.stack([x.ravel(), y.ravel()], axis=1), self.size)
        return rays.reshape(self.size[1], self.size[0], 3).astype(np.float32)

    def _field(self, orientation: Orientation) -> Singles:
        """Grass in stripes, lines and sky in every second pixel (height / 2, width / 2, 3)."""
        rays = self._rays[::2, ::2] @ orientation.rotation.T.astype(np.float32)
        reach = orientation.height / np.maximum(-rays[..., 2], 0.01)
        x, y = reach * rays[..., 0], reach * rays[..., 1]
        image = np.empty_like(rays)
        image[:] = _GRASS
        image += (_STRIPES * (np.remainder(x, 2.0 * _STRIPE) < _STRIPE)).astype(np.float32)[..., None]
        image[(np.remainder(x, _LINES) < _LINE) | (np.remainder(y, _LINES) < _LINE)] = _WHITE
        image[rays[..., 2] > _HORIZON] = _SKY
        return image

    def _draw_ball(self, image: Singles, orientation: Orientation, captured: float) -> None:
        """The ball, lit from above, and the shadow around where it stands, into an image (height * width, 3)."""
        center = self.motion.ball(captured) - (0.0, 0.0, orientation.height)
        square = float(center @ center)
        toward = (orientation.rotation.T @ center).astype(np.float32)
        near = np.flatnonzero(self._rays.reshape(-1, 3) @ toward > math.sqrt(max(square - 4.0 * RADIUS**2, 0.0)))
        rays = self._rays.reshape(-1, 3)[near].astype(np.float64) @ orientation.rotation.T
        along = rays @ center
        below = rays * (orientation.height / np.maximum(-rays[:, 2:], 0.01)) - center
        dark = (below[:, :2] ** 2).sum(axis=1) < (0.6 * RADIUS) ** 2
        image[near[dark]] *= 0.5
        inside = along**2 - (square - RADIUS**2)
        hit = inside > 0.0
        normals = (rays[hit] * (along[hit] - np.sqrt(inside[hit]))[:, None] - center) / RADIUS
        rolled = normals @ cv2.Rodrigues(captured * np.array([0.3, 1.0, 0.2]))[0]
        patch = (rolled @ _PATCHES.T).max(axis=1) > 0.93
        light = 0.55 + 0.45 * np.clip(normals[:, 2:], -0.6, 1.0)
        image[near[hit]] = np.where(patch[:, None], _PATCH, _BALL) * light


def lens_of(size: Size) -> Lens:
    """The lens of pictures of that size."""
    focal_length = _FOCAL_LENGTH * size[0]
    diagonal = math.hypot(*size)
    return Rectilinear(focal_length=focal_length, fov=2.0 * math.atan(diagonal / focal_length), size=size)
