"""Words and logos that are printed on balls."""

from __future__ import annotations

import math

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Number, Singles
from vm_embedded.borders.opencv_text import draw_text, text_size

from .painting_sphere import PaintingSphere


def print_images(sphere: PaintingSphere, centers: Floats, half: float, images: list[Singles], turns: Floats) -> Singles:
    """Mask with images (size, size) at the centers (n, 3), each 2 * half [rad] wide and turned by an angle [rad]."""
    # A blur as wide as a texel prevents aliasing.
    blur = max(0.4 * sphere.texel * images[0].shape[0] / (2.0 * half), 0.3)
    images = [np.asarray(cv2.GaussianBlur(image, (0, 0), blur)) for image in images]

    def printed(x: Number, y: Number, i: int) -> Singles:
        image, cosine, sine = images[i % len(images)], math.cos(turns[i]), math.sin(turns[i])
        places = (
            (along / half + 1.0) * 0.5 * len(image) - 0.5 for along in (cosine * x + sine * y, sine * x - cosine * y)
        )
        # cv2.remap accepts at most 32767 columns.
        column, row = (np.resize(place, (len(x) // 1024 + 1, 1024)).astype(np.float32) for place in places)
        return np.asarray(cv2.remap(image, column, row, cv2.INTER_LINEAR), np.float32).ravel()[: len(x)]

    return sphere.stamp(centers, 1.4 * half, printed)


def word(random: np.random.Generator) -> Singles:
    """A random word or number as a mask (96, 96)."""
    image = np.zeros((96, 96), np.uint8)
    text = "".join(random.choice(list("ABCDEFGHIKLMNOPRSTUVXYZ0123456789"), size=random.integers(1, 7)))
    font, thick = int(random.choice([0, 2, 3, 4])), int(random.integers(2, 7))
    wide, high, _ = text_size(text, 1.0, thick, font)
    scale = min(84.0 / wide, 60.0 / high)
    corner = int(48 - 0.5 * wide * scale), int(48 + 0.5 * high * scale)
    draw_text(image, text, corner, scale, 255, thick, font)
    return image.astype(np.float32) / 255.0


def logo(random: np.random.Generator) -> Singles:
    """A random logo of arcs, rings and polygons as a mask (96, 96)."""
    image = np.zeros((96, 96), np.uint8)
    for _ in range(random.integers(1, 4)):
        if random.random() < 0.5:
            column, row, wide, high = random.integers((34, 34, 12, 8), (62, 62, 32, 32)).tolist()
            thick, turn, end = random.integers((4, 0, 120), (14, 360, 361)).tolist()
            cv2.ellipse(image, (column, row), (wide, high), turn, 0, end, 255, thick, cv2.LINE_AA)
        else:
            corners = random.integers(16, 80, (random.integers(3, 6), 2)).astype(np.int32)
            cv2.fillPoly(image, [corners], 255, cv2.LINE_AA)
    return image.astype(np.float32) / 255.0
