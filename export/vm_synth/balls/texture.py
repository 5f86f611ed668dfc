"""Paints the design of a ball as a texture."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Singles

from .design import BallDesign, Color
from .painting_sphere import PaintingSphere, normalized, texture_directions
from .patterns import PATTERNS
from .prints import logo, print_images, word


def paint_texture(design: BallDesign, height: int = 512) -> Singles:
    """Albedo texture (height, 2 height, 3) of a ball, linear RGB, 0 to 1.

    The center of pixel (column, row) is the direction (sin p cos a, sin p sin a, cos p) with the polar angle
    p = pi (row + 0.5) / height and the azimuth a = pi (column + 0.5) / height. Row 0 is at the pole z = 1.
    """
    sphere = PaintingSphere(texture_directions(height))
    texture = np.empty_like(sphere.directions)
    texture[:] = np.array(design.base, np.float32)[:, None, None]
    ink, accent, seams = PATTERNS[design.kind](sphere, design)
    worn = _wear(sphere, design) if design.wear else None
    for color, mask in ((design.ink, ink), (design.accent, accent)):
        _mix(texture, color, mask if worn is None else mask * worn[0])
    if design.marks:
        random = design.random(1)
        centers, turns = normalized(random.normal(size=(design.marks, 3))), random.uniform(0.0, 6.28, design.marks)
        images = [word(random) if random.random() < 0.5 else logo(random) for _ in centers]
        _mix(texture, design.ink, print_images(sphere, centers, random.uniform(0.12, 0.35), images, turns))
    _mix(texture, design.seam_color, seams)
    if worn is not None:
        _mix(texture, design.dirt, worn[1])
    return np.ascontiguousarray(np.moveaxis(np.clip(texture, 0.0, 1.0, out=texture), 0, 2))


def _mix(texture: Singles, color: Color, mask: Singles) -> None:
    """Blend a color into a texture (3, height, width) with the opacity of a mask (height, width), in place."""
    for channel, value in zip(texture, color, strict=True):
        channel += (np.float32(value) - channel) * mask


def _wear(sphere: PaintingSphere, design: BallDesign) -> tuple[Singles, Singles]:
    """The remaining share of the ink, and the opacity of dirt: (height, width) each, 0 to 1."""
    random, wear = design.random(2), np.float32(design.wear)
    # With waves of few lengths the noise would look woven.
    coarse, middle, fine = (sphere.noise(random, *each) for each in ((3.5, 10), (15.0, 16), (45.0, 24)))
    rough = 0.55 * coarse + 0.35 * middle + 0.45 * fine
    left = (1.0 - random.uniform(0.0, 0.5) * wear) * np.clip(2.6 - 1.2 * wear - rough, 0.0, 1.0)
    dirt = np.clip(0.25 * (rough + coarse) + 0.7 * wear - 0.6, 0.0, 0.6) + random.uniform(0.0, 0.25) * wear
    for _ in range(int(10 * wear)):
        along = sphere.cosine_to(normalized(random.normal(size=3)))
        scratch = sphere.line(
            sphere.cosine_to(normalized(random.normal(size=3))) - np.float32(random.uniform(-0.8, 0.8)), 0.012
        )
        dirt = np.maximum(dirt, scratch * np.clip(8.0 * along - 6.5, 0.0, 0.6))
    return np.asarray(left, np.float32), np.asarray(np.clip(dirt, 0.0, 0.9), np.float32)
