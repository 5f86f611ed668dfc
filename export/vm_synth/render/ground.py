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
    x, y = np.ascontiguousarray(local[..., 0]), np.ascontiguousarray(local[..., 1])
    ax, ay = np.abs(x), np.abs(y)
    steps = change_per_pixel(ax), change_per_pixel(ay)
    if math.isinf(field.border):
        carpet = seen.astype(np.float32)
    else:
        carpet = share_inside(field.length / 2.0 + field.border - ax, steps[0])
        carpet *= share_inside(field.width / 2.0 + field.border - ay, steps[1]) * seen
    lines = _line_shares(field, x, y, steps) * seen
    slow = color_patches(field.seed, points)
    if field.wear:
        lines = lines * (1.0 - np.clip(4.0 * (field.wear - 0.5 + 5.0 * slow[..., 1]), 0.0, 0.95))

    footprint = np.where(seen, range_ * pixel, 1.0)
    grain = turf_texture(field.turf, field.seed % 3, points, footprint)
    grass = np.array(field.grass, dtype=np.float32) * (1.0 + field.texture * (grain + slow))
    if field.stripe:
        shade = 0.5 + np.clip(np.sin(np.pi * x / field.stripe) / change_per_pixel(np.pi * x / field.stripe), -0.5, 0.5)
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


def _line_shares(field: Field, x: Floats, y: Floats, steps: tuple[Floats, Floats]) -> Singles:
    """Share (h, w) of each pixel covered by lines, at field coordinates x and y (h, w) [m].

    steps: changes per pixel (h, w) of |x| and |y|. The lines are the outline, halfway line, center circle, goal and
    penalty areas, and the center and penalty marks.
    """
    half_length, half_width, line = field.length / 2.0, field.width / 2.0, field.line_width
    ax, ay = np.abs(x), np.abs(y)
    lines = _rectangle(ax, ay, steps, half_length, half_width, line)
    halfway = _share_near(x, change_per_pixel(x), line) * share_inside(half_width - ay, steps[1])
    np.maximum(lines, halfway, out=lines)
    around = np.hypot(x, y)
    outward = change_per_pixel(around)
    np.maximum(lines, _share_near(around - field.length / 12.0, outward, line), out=lines)
    for depth, breadth in ((field.length / 9.0, field.width / 2.0), (field.length / 4.5, field.width / 1.2)):
        # The frame of an area; its outer side lies on the goal line.
        across = np.abs(ax - half_length + depth / 2.0)
        frame = _rectangle(across, ay, (change_per_pixel(across), steps[1]), depth / 2.0, breadth / 2.0, line)
        np.maximum(lines, frame, out=lines)
    mark = np.hypot(ax - half_length + field.length / 6.0, y)
    for distance, step in ((mark, change_per_pixel(mark)), (around, outward)):
        np.maximum(lines, share_inside(line - distance, step), out=lines)
    return np.asarray(lines)


def _rectangle(
    ax: Floats, ay: Floats, steps: tuple[Floats, Floats], half_length: float, half_width: float, line: float
) -> Singles:
    """Share (h, w) of each pixel covered by the lines around a rectangle.

    ax, ay: |x| and |y| (h, w) [m]. steps: their changes per pixel (h, w).
    """
    sides = _share_near(ax - half_length, steps[0], line) * share_inside(half_width + line / 2.0 - ay, steps[1])
    ends = _share_near(ay - half_width, steps[1], line) * share_inside(half_length + line / 2.0 - ax, steps[0])
    return np.asarray(np.maximum(sides, ends))


def _share_near(distance: Floats, step: Floats, width: float) -> Singles:
    """Share (h, w) of each pixel covered by a line of this width [m].

    distance: signed, to its middle (h, w) [m]. step: its change per pixel (h, w).
    """
    half = np.minimum(step, 1e6) / 2.0
    over = np.minimum(distance + half, width / 2.0) - np.maximum(distance - half, -width / 2.0)
    return np.asarray(np.maximum(over, 0.0) / (2.0 * half), dtype=np.float32)


def share_inside(distance: Floats, step: Floats) -> Singles:
    """Share (h, w) of each pixel on the positive side of an edge.

    distance: signed, to the edge (h, w) [m]. step: its change per pixel (h, w).
    """
    return np.asarray(np.clip(0.5 + distance / step, 0.0, 1.0), dtype=np.float32)


def change_per_pixel(distance: Floats) -> Floats:
    """How much a distance (h, w) changes from one pixel to the next.

    The smaller change to either neighbor counts, because one of them may show the sky.
    """
    change = np.hypot(_smaller_step(distance), _smaller_step(distance.T).T)
    return np.asarray(np.maximum(change, 1e-9))


def _smaller_step(distance: Floats) -> Floats:
    """The smaller difference to the neighbors above and below (h, w)."""
    step = np.empty_like(distance)
    change = np.diff(distance, axis=0)
    np.abs(change, out=change)
    np.minimum(change[:-1], change[1:], out=step[1:-1])
    step[0], step[-1] = change[0], change[-1]
    return step
