"""The ground as the camera sees it: lines, turf and uneven light on the plane."""

from __future__ import annotations

import math

import numpy as np

from vm_embedded.arrays import Floats, Singles

from ..scene.field import Field
from .turf import color_patches, turf_texture


def paint_ground(field: Field, points: Floats, range_: Floats, pixel: float) -> tuple[Singles, Singles, Singles]:
    """Albedo (h, w, 3) of the ground, and the shares (h, w) of each pixel that lines and carpet cover.

    points: where each pixel sees the plane (h, w, 2) [m], infinite above the horizon. range_: distances (h, w) of these
    points from the camera [m]. pixel: angle between neighboring pixels [rad].
    """
    seen = np.isfinite(points[..., 0])
    local = (np.where(seen[..., None], points, 1e6) - np.array(field.middle)) @ field.rotation
    x, y = local[..., 0], local[..., 1]
    if math.isinf(field.border):
        carpet = seen.astype(np.float32)
    else:
        carpet = _share_inside(field.length / 2.0 + field.border - np.abs(x))
        carpet *= _share_inside(field.width / 2.0 + field.border - np.abs(y)) * seen
    lines = _line_shares(field, x, y) * seen
    slow = color_patches(field.seed, points)
    if field.wear:
        lines = lines * (1.0 - np.clip(4.0 * (field.wear - 0.5 + 5.0 * slow[..., 1]), 0.0, 0.95))

    footprint = np.where(seen, range_ * pixel, 1.0)
    grain = turf_texture(field.turf, field.seed % 3, points, footprint)
    grass = np.array(field.grass, dtype=np.float32) * (1.0 + field.texture * (grain + slow))
    if field.stripe:
        shade = 0.5 + np.clip(np.sin(np.pi * x / field.stripe) / _change_per_pixel(np.pi * x / field.stripe), -0.5, 0.5)
        grass *= (0.88 + 0.24 * shade[..., None]).astype(np.float32)
    paint = field.paint * (1.0 + 0.3 * field.texture * grain.mean(axis=-1, keepdims=True))
    # Thin paint covers the bright tips of the blades, not the dark ground between them.
    covering = np.clip(field.cover + (1.0 - field.cover) * 2.0 * grain, 0.0, 1.0)
    albedo = grass + lines[..., None] * covering * (paint - grass)
    return np.clip(albedo, 0.01, 0.95).astype(np.float32), lines.astype(np.float32), carpet.astype(np.float32)


def ground_light(points: Floats, seed: int) -> Singles:
    """Slow changes (h, w) of the light over points (h, w, 2) [m] of the plane, from -1 to 1."""
    random = np.random.default_rng(seed)
    turn, length = random.uniform(0.0, 2.0 * np.pi, 3), random.uniform(3.0, 9.0, 3)
    safe = np.where(np.isfinite(points), points, 0.0)
    waves = [
        np.sin((safe @ [np.cos(a), np.sin(a)]) * (2.0 * np.pi / each) + a) for a, each in zip(turn, length, strict=True)
    ]
    return np.asarray(sum(waves) / 3.0, dtype=np.float32)


def _line_shares(field: Field, x: Floats, y: Floats) -> Singles:
    """Share (h, w) of each pixel covered by lines, at field coordinates x and y (h, w) [m].

    The lines are the outline, halfway line, center circle, goal and penalty areas, and the center and penalty marks.
    """
    half_length, half_width, line = field.length / 2.0, field.width / 2.0, field.line_width
    ax, ay = np.abs(x), np.abs(y)
    lines = np.maximum(
        _rectangle(ax, ay, half_length, half_width, line), _share_near(x, line) * _share_inside(half_width - ay)
    )
    around = np.hypot(x, y)
    np.maximum(lines, _share_near(around - field.length / 12.0, line), out=lines)
    for depth, breadth in ((field.length / 9.0, field.width / 2.0), (field.length / 4.5, field.width / 1.2)):
        # The frame of an area; its outer side lies on the goal line.
        area = _rectangle(np.abs(ax - half_length + depth / 2.0), ay, depth / 2.0, breadth / 2.0, line)
        np.maximum(lines, area, out=lines)
    for mark in (np.hypot(ax - half_length + field.length / 6.0, y), around):
        np.maximum(lines, _share_inside(line - mark), out=lines)
    return np.asarray(lines)


def _rectangle(ax: Floats, ay: Floats, half_length: float, half_width: float, line: float) -> Singles:
    """Share (h, w) of each pixel covered by the lines around a rectangle, from |x| and |y| (h, w) [m]."""
    sides = _share_near(ax - half_length, line) * _share_inside(half_width + line / 2.0 - ay)
    ends = _share_near(ay - half_width, line) * _share_inside(half_length + line / 2.0 - ax)
    return np.asarray(np.maximum(sides, ends))


def _share_near(distance: Floats, width: float) -> Singles:
    """Share (h, w) of each pixel covered by a line of this width [m]; distance: signed, to its middle (h, w)."""
    half = np.minimum(_change_per_pixel(distance), 1e6) / 2.0
    over = np.minimum(distance + half, width / 2.0) - np.maximum(distance - half, -width / 2.0)
    return np.asarray(np.clip(over, 0.0, None) / (2.0 * half), dtype=np.float32)


def _share_inside(distance: Floats) -> Singles:
    """Share (h, w) of each pixel on the positive side of an edge, from the signed distances (h, w) to it [m]."""
    return np.asarray(np.clip(0.5 + distance / _change_per_pixel(distance), 0.0, 1.0), dtype=np.float32)


def _change_per_pixel(distance: Floats) -> Floats:
    """How much a distance (h, w) changes from one pixel to the next.

    The smaller change to either neighbor counts, because one of them may show the sky.
    """
    change = np.hypot(_smaller_step(distance), _smaller_step(distance.T).T)
    return np.asarray(np.maximum(change, 1e-9))


def _smaller_step(distance: Floats) -> Floats:
    """The smaller difference to the neighbors above and below (h, w)."""
    step = np.abs(np.diff(distance, axis=0))
    return np.asarray(np.minimum(np.concatenate([step[:1], step]), np.concatenate([step, step[-1:]])))
