"""Built-in light: imaginary rooms with windows, lamps and furniture, for users without environment maps."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from vm_embedded.arrays import Singles

from .environment import Environment

ROOMS, HELD_OUT_ROOMS = range(48), range(48, 60)
"""Numbers of the rooms for training and for testing."""

_SIZE = (512, 256)  # columns and rows


def room_name(number: int) -> str:
    """The name of a room."""
    return f"room{number:02d}"


def furnish_room(number: int) -> Environment:
    """The environment of a room; the same number gives the same room."""
    random = np.random.default_rng([41, number])
    width, height = _SIZE
    picture = np.empty((height, width, 3), dtype=np.float32)
    ceiling, ground = int(random.uniform(0.2, 0.4) * height), int(random.uniform(0.6, 0.75) * height)
    for rows, bright in ((slice(0, ceiling), 0.8), (slice(ceiling, ground), 0.5), (slice(ground, height), 0.3)):
        picture[rows] = bright * _color(random)
    _add_boxes(random, picture, int(random.integers(20, 70)), (0.3, 0.95), (0.02, 0.9))
    _add_boxes(random, picture, int(random.integers(15, 50)), (0.45, 0.8), (0.02, 0.9), smaller=0.35)
    picture *= 1.0 + 0.2 * cv2.GaussianBlur(random.standard_normal(picture.shape, dtype=np.float32), (0, 0), 0.8)
    slow = cv2.resize(random.uniform(0.6, 1.4, (4, 8, 1)).astype(np.float32), _SIZE, interpolation=cv2.INTER_CUBIC)
    picture *= np.maximum(slow, 0.2)[..., None]
    blurred = cv2.GaussianBlur(picture, (0, 0), random.uniform(0.6, 1.6))
    lamps = np.zeros_like(picture)
    _add_boxes(random, lamps, int(random.integers(1, 7)), (0.02, 0.42), (3.0, 60.0), smaller=0.5)
    light = blurred + cv2.GaussianBlur(lamps, (0, 0), random.uniform(0.8, 3.0))
    return Environment(room_name(number), np.maximum(light, 1e-3).astype(np.float32), None)


def _add_boxes(
    random: np.random.Generator,
    picture: Singles,
    count: int,
    rows: tuple[float, float],
    light: tuple[float, float],
    smaller: float = 1.0,
) -> None:
    """Paint rectangles with their middle in these rows, as shares of the height, and a radiance in this range."""
    height, width = picture.shape[:2]
    for _ in range(count):
        x, y = random.uniform(0.0, width), random.uniform(*rows) * height
        half = smaller * np.exp(random.uniform(np.log(3.0), np.log(45.0), 2))
        strength = float(np.exp(random.uniform(*np.log(light))))
        color = (strength * (0.7 + 0.3 * _color(random)) if light[1] > 1.0 else strength * _color(random)).tolist()
        for shift in (-width, 0, width):
            first = int(x + shift - half[0]), int(y - half[1])
            last = int(x + shift + half[0]), int(y + half[1])
            cv2.rectangle(picture, first, last, color, -1)


def _color(random: np.random.Generator) -> Singles:
    saturation = random.uniform(0.0, 0.2) if random.random() < 0.6 else random.uniform(0.2, 0.9)
    return np.array(colorsys.hsv_to_rgb(random.random(), saturation, 1.0), dtype=np.float32)
