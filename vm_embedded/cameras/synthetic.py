"""A synthetic camera: it draws a field, sways and turns above it, and a ball rolls in front of it.

It replaces hardware in demonstrations and tests. The poses of camera and ball depend only on the time, so Motion gives
the ground truth of any moment.
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
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation
from ..geometry.radial_lenses import Rectilinear
from .camera import CameraSettings, Shot

SIZE = (640, 512)
RATE = 30.0
RADIUS = 0.095
"""Radius of the ball [m]."""

_FOCAL_LENGTH = 0.7  # in widths of the image
_LINES, _LINE, _STRIPE = 3.0, 0.08, 1.4  # [m] distance between lines, width of a line and of a stripe in the grass
_HORIZON = -0.03  # z of the rays at which the field ends
_NOISE = 3.0  # standard deviation, in gray values
_SPARE = 64  # [px] by which the noise pattern is larger than the image

_GRASS, _STRIPES, _SKY = (48.0, 118.0, 52.0), 14.0, (190.0, 170.0, 150.0)
_BALL, _PATCH, _WHITE = (235.0, 238.0, 240.0), (28.0, 26.0, 24.0), (225.0, 228.0, 225.0)

_GOLDEN = (1.0 + math.sqrt(5.0)) / 2.0
_PATCHES: Floats = np.array(
    [each for a in (-1.0, 1.0) for b in (-_GOLDEN, _GOLDEN) for each in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))]
) / math.hypot(1.0, _GOLDEN)
"""Centers (12, 3) of the ball's black patches: the corners of an icosahedron."""


@dataclass(frozen=True)
class Motion:
    """The poses of camera and ball at each moment of the monotonic clock [s].

    turn: angular velocity of the camera around the vertical [rad/s].
    """

    turn: float = 0.2

    def orientation(self, time: float) -> Orientation:
        """Orientation of the camera at a time [s]."""
        return Orientation.from_roll_pitch(
            height=0.8 + 0.02 * math.sin(9.0 * time),
            roll=0.04 * math.sin(4.5 * time),
            pitch=0.4 + 0.03 * math.cos(9.0 * time),
            yaw=math.remainder(self.turn * time, 2.0 * math.pi),
        )

    def ball(self, time: float) -> Floats:
        """Center (3,) of the ball at a time [s], relative to the point below the camera [m]."""
        distance = 2.0 + 0.7 * math.sin(0.9 * time)
        bearing = self.turn * time + 0.3 * math.sin(0.6 * time)
        return np.array([distance * math.cos(bearing), distance * math.sin(bearing), RADIUS])


def parse_motion(source: str) -> Motion:
    """The motion of "synthetic" or "synthetic:TURN", TURN in rad/s. Raises InputError."""
    _, colon, turn = source.partition(":")
    try:
        motion = Motion(float(turn)) if colon else Motion()
    except ValueError:
        motion = Motion(math.nan)
    if not abs(motion.turn) <= 100.0:
        raise InputError(f"TURN in synthetic:TURN must be a number from -100 to 100 rad/s, not {turn!r}")
    return motion


class SyntheticCamera:
    """Draws each shot when it is due, with its orientation, and the ball's position as ground truth."""

    def __init__(self, settings: CameraSettings) -> None:
        self.settings = settings
        self.motion = parse_motion(settings.source)
        self.size: Size = (settings.width or SIZE[0], settings.height or SIZE[1])
        self.lens = _synthetic_lens(self.size)
        self._period = 1.0 / (settings.fps or RATE)
        self._due = time.monotonic()
        self._random = np.random.default_rng(0)
        noise_shape = (self.size[1] + _SPARE, self.size[0] + _SPARE, 3)
        self._noise = self._random.normal(0.0, _NOISE, noise_shape).astype(np.float32)

    def read(self) -> Shot:
        """Return the next shot when it is due."""
        self._due = max(self._due + self._period, time.monotonic() - self._period)
        captured = self._due - 1e-3 * self.settings.latency_ms
        image = self.draw(captured)
        time.sleep(max(self._due - time.monotonic(), 0.0))
        truth = {"ball": [round(float(each), 4) for each in self.motion.ball(captured)]}
        return Shot(image, captured, None, self.motion.orientation(captured), self.lens, truth)

    def close(self) -> None:
        """Do nothing: a synthetic camera holds no device."""

    def draw(self, captured: float) -> Image:
        """Draw the image (height, width, 3) of a moment [s], BGR."""
        orientation = self.motion.orientation(captured)
        image: Singles = np.asarray(cv2.resize(self._field(orientation), self.size), dtype=np.float32)
        self._draw_ball(image.reshape(-1, 3), orientation, captured)
        down, right = self._random.integers(0, _SPARE, 2)
        noise = self._noise[down : down + self.size[1], right : right + self.size[0]]
        return np.asarray(np.clip(image + noise, 0.0, 255.0), dtype=np.uint8)

    @cached_property
    def _rays(self) -> Singles:
        """Rays (height, width, 3) of all pixels in the camera's frame."""
        x, y = np.meshgrid(np.arange(self.size[0], dtype=float), np.arange(self.size[1], dtype=float))
        rays = self.lens.unproject(np.stack([x.ravel(), y.ravel()], axis=1), self.size)
        return rays.reshape(self.size[1], self.size[0], 3).astype(np.float32)

    def _field(self, orientation: Orientation) -> Singles:
        """Grass in stripes, lines and sky at half the resolution (height / 2, width / 2, 3)."""
        rays = self._rays[::2, ::2] @ orientation.rotation.T.astype(np.float32)
        distance = orientation.height / np.maximum(-rays[..., 2], 0.01)
        x, y = distance * rays[..., 0], distance * rays[..., 1]
        image = np.empty_like(rays)
        image[:] = _GRASS
        image += (_STRIPES * (np.remainder(x, 2.0 * _STRIPE) < _STRIPE)).astype(np.float32)[..., None]
        image[(np.remainder(x, _LINES) < _LINE) | (np.remainder(y, _LINES) < _LINE)] = _WHITE
        image[rays[..., 2] > _HORIZON] = _SKY
        return image

    def _draw_ball(self, image: Singles, orientation: Orientation, captured: float) -> None:
        """Draw the ball, lit from above, and the shadow below it into an image (height * width, 3)."""
        center = self.motion.ball(captured) - (0.0, 0.0, orientation.height)  # from the camera, z up
        square = float(center @ center)
        toward = (orientation.rotation.T @ center).astype(np.float32)
        ahead = np.einsum("ij,j->i", self._rays.reshape(-1, 3), toward)  # with @, OpenBLAS occupies all cores
        near = np.flatnonzero(ahead > math.sqrt(max(square - 4.0 * RADIUS**2, 0.0)))
        rays = self._rays.reshape(-1, 3)[near].astype(np.float64) @ orientation.rotation.T

        on_ground = rays * (orientation.height / np.maximum(-rays[:, 2:], 0.01)) - center
        shadow = (on_ground[:, :2] ** 2).sum(axis=1) < (0.6 * RADIUS) ** 2
        image[near[shadow]] *= 0.5

        along = rays @ center
        discriminant = along**2 - (square - RADIUS**2)  # of the intersection of ray and sphere
        hit = discriminant > 0.0
        normals = (rays[hit] * (along[hit] - np.sqrt(discriminant[hit]))[:, None] - center) / RADIUS
        rolled = normals @ cv2.Rodrigues(captured * np.array([0.3, 1.0, 0.2]))[0]
        patch = (rolled @ _PATCHES.T).max(axis=1) > 0.93
        light = 0.55 + 0.45 * np.clip(normals[:, 2:], -0.6, 1.0)
        image[near[hit]] = np.where(patch[:, None], _PATCH, _BALL) * light


def _synthetic_lens(size: Size) -> Lens:
    """The lens of a synthetic camera with images of a size (width, height) [px]."""
    focal_length = _FOCAL_LENGTH * size[0]
    diagonal = math.hypot(*size)
    return Rectilinear(focal_length=focal_length, fov=2.0 * math.atan(diagonal / focal_length), size=size)
