"""Primitive solids. Flat faces have separate vertices; round ones share vertices with smooth normals.

By default a primitive is centered on the origin with its axis along z. All are white until they are painted.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats

from .solids import Point, Solid, along_each, between, distance, rotation

_SMOOTH = float(np.cos(np.radians(50.0)))
"""Cosine of the largest angle between faces of a profile that share a smooth normal."""


def box(x: float, y: float, z: float) -> Solid:
    """A box with these sides [m]."""
    return _cube(np.array([-1.0, 1.0]), np.array([x, y, z]) / 2.0, 0.0)


def rounded_box(x: float, y: float, z: float, radius: float) -> Solid:
    """A box with these sides [m] whose edges are rounded with a radius [m], at most half the shortest side."""
    half = np.array([x, y, z]) / 2.0
    return _cube(np.array([-1.0, -0.7, 0.0, 0.0, 0.7, 1.0]), half, min(radius, float(half.min()) * 0.999))


def lathe(profile: Sequence[tuple[float, float]], segments: int = 16) -> Solid:
    """A profile of points (radius, z) [m] rotated about z. It runs upward on the outside and inward on top."""
    steps = np.array([(a, b) for a, b in pairwise(profile) if a != b])
    slopes = np.stack([steps[:, 1, 1] - steps[:, 0, 1], steps[:, 0, 0] - steps[:, 1, 0]], axis=1)
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    leans = np.stack([slopes, slopes], axis=1)
    both = slopes[:-1] + slopes[1:]
    smooth = (slopes[:-1] * slopes[1:]).sum(axis=1) > _SMOOTH
    shared = both[smooth] / np.linalg.norm(both[smooth], axis=1, keepdims=True)
    leans[:-1, 1][smooth] = leans[1:, 0][smooth] = shared
    around = np.arange(segments) * (2.0 * np.pi / segments)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    here = np.arange(segments)
    there = (here + 1) % segments
    pair = np.stack([[here, there, segments + there], [here, segments + there, segments + here]]).transpose(0, 2, 1)
    triangles = 2 * segments * np.arange(len(steps))[:, None, None, None] + pair
    # A step that starts or ends on the axis has only one triangle per segment.
    triangles = triangles[steps[:, :, 0] > 0.0].reshape(-1, 3)
    return _solid(_swept(steps.reshape(-1, 2), circle), _swept(leans.reshape(-1, 2), circle), triangles)


def cylinder(radius: float, height: float, segments: int = 16, top: float | None = None) -> Solid:
    """A closed cylinder; with another radius at the top [m], a cone or truncated cone."""
    upper = radius if top is None else top
    half = height / 2.0
    return lathe([(0.0, -half), (radius, -half), (upper, half), (0.0, half)], segments)


def prism(corners: int, lower: float, upper: float, height: float) -> Solid:
    """A closed upright prism or stump with flat sides, on z = 0; one side faces +x.

    lower, upper: distances of the lower and the upper corners from the axis [m].
    """
    around = (np.arange(corners) + 0.5) * (2.0 * np.pi / corners)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    bottom, top = (
        np.column_stack([radius * circle, np.full(corners, z)]) for radius, z in ((lower, 0.0), (upper, height))
    )
    quads = np.stack([np.roll(bottom, 1, axis=0), bottom, top, np.roll(top, 1, axis=0)], axis=1)
    outward = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    ends = np.repeat([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], corners, axis=0)
    fan = np.stack([np.zeros(corners - 2), np.arange(1, corners - 1), np.arange(2, corners)], axis=1)
    sides = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = [4 * corners + fan[:, ::-1], 5 * corners + fan, *(4 * side + sides for side in range(corners))]
    return _solid(
        np.concatenate([quads.reshape(-1, 3), bottom, top]),
        np.concatenate([np.repeat(outward, 4, axis=0), ends]),
        np.concatenate(triangles).astype(np.int32),
    )


def sphere(radius: float, segments: int = 16) -> Solid:
    """A sphere. Stretch it for an ellipsoid."""
    return lathe(arc(radius, -np.pi / 2.0, np.pi / 2.0, max(segments // 2, 4)), segments)


def dome(radius: float, height: float, segments: int = 20) -> Solid:
    """Half an ellipsoid on z = 0."""
    upper = lathe([(0.0, 0.0), *arc(radius, 0.0, np.pi / 2.0, segments // 3)], segments)
    return upper.stretched(1.0, 1.0, height / radius)


def torus(radius: float, thickness: float) -> Solid:
    """A ring around z, with the radius of its center line [m] and its thickness [m]."""
    sides = 12
    around = np.append(np.arange(sides), 0) * (2.0 * np.pi / sides) - np.pi / 2.0
    ring = [(radius + thickness / 2.0 * float(np.cos(a)), thickness / 2.0 * float(np.sin(a))) for a in around]
    return lathe(ring, 32)


def capsule(start: Point, end: Point, radius: float, last: float | None = None, segments: int = 10) -> Solid:
    """A rod with round ends between two points; `last` is its radius [m] at the end if it differs."""
    final = radius if last is None else last
    half = max(distance(start, end), 1e-4) / 2.0
    lower = [(r, z - half) for r, z in arc(radius, -np.pi / 2.0, 0.0, 3)]
    upper = [(r, z + half) for r, z in arc(final, 0.0, np.pi / 2.0, 3)]
    return between(lathe([*lower, *upper], segments), start, end)


def rod(start: Point, end: Point, radius: float, last: float | None = None, segments: int = 10) -> Solid:
    """A rod with flat ends between two points; `last` is its radius [m] at the end if it differs."""
    return between(cylinder(radius, distance(start, end), segments, last), start, end)


def beam(start: Point, end: Point, x: float, y: float) -> Solid:
    """A box between two points with a cross section of x by y [m]."""
    return between(box(x, y, distance(start, end)), start, end)


def axle(center: Point, radius: float, width: float, segments: int = 14) -> Solid:
    """A closed cylinder with its axis along y, for wheels, joints and ears."""
    return cylinder(radius, width, segments).turned(rotation(roll=np.pi / 2.0)).shifted(center)


def cord(points: Floats, radius: float) -> Solid:
    """A cord along points (k, 3) [m] with open ends."""
    return cords(points[None], radius)


def cords(points: Floats, radius: float, sides: int = 5) -> Solid:
    """Cords along n rows of points (n, k, 3) [m] with open ends."""
    count, length = points.shape[:2]
    ahead = np.gradient(points, axis=1).reshape(-1, 3)
    around = np.arange(sides) * (2.0 * np.pi / sides)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros(sides)], axis=1)
    normals = circle @ along_each(ahead).transpose(0, 2, 1)
    here = np.arange(sides)
    there = (here + 1) % sides
    starts = (np.arange(count)[:, None] * length + np.arange(length - 1)) * sides
    quads = np.concatenate(
        [np.stack([here, there, there + sides], 1), np.stack([here, there + sides, here + sides], 1)]
    )
    vertices = points.reshape(-1, 1, 3) + radius * normals
    triangles = starts[:, :, None, None] + quads
    return _solid(vertices.reshape(-1, 3), normals.reshape(-1, 3), triangles.reshape(-1, 3))


def sheet(outline: Floats, thickness: float) -> Solid:
    """A flat sheet on z = 0. Its outline (k, 2) [m] is counterclockwise and star-shaped around the origin."""
    count = len(outline)
    ring = np.column_stack([outline, np.full(count, thickness)])
    wall = np.column_stack([np.roll(outline, -1, axis=0) - outline, np.zeros(count)])
    outward = np.stack([wall[:, 1], -wall[:, 0], wall[:, 2]], axis=1)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)
    here = np.arange(count)
    there = (here + 1) % count
    floor = ring * (1.0, 1.0, 0.0)
    vertices = np.concatenate([[[0.0, 0.0, thickness]], ring, ring, ring[there], floor, floor[there]])
    normals = np.concatenate([np.tile([0.0, 0.0, 1.0], (count + 1, 1)), np.tile(outward, (4, 1))])
    top = np.stack([np.zeros_like(here), 1 + here, 1 + there], axis=1)
    a, b, c, d = (1 + k * count + here for k in (1, 2, 3, 4))
    return _solid(vertices, normals, np.concatenate([top, np.stack([a, c, d], 1), np.stack([a, d, b], 1)]))


def icosphere(radius: float, splits: int = 3) -> Solid:
    """A sphere of 20 * 4 ** splits triangles of about equal size, for patterns."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [(a, b * golden, 0.0) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(corner, k) for k in range(3) for corner in corners])
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < 2.1
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    corner = points[np.array(faces)]
    inward = (
        np.einsum("ij,ij->i", np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), corner[:, 0]) < 0.0
    )
    corner[inward] = corner[inward][:, ::-1]
    for _ in range(splits):
        a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
        ab, bc, ca = (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0
        corner = np.concatenate(
            [np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
        corner /= np.linalg.norm(corner, axis=2, keepdims=True)
    # Rounding makes the corners that neighboring triangles share bitwise equal.
    corners_, triangles = np.unique(corner.reshape(-1, 3).round(9), axis=0, return_inverse=True)
    normals = corners_ / np.linalg.norm(corners_, axis=1, keepdims=True)
    return _solid(radius * normals, normals, triangles.reshape(-1, 3))


def arc(radius: float, first: float, last: float, steps: int) -> list[tuple[float, float]]:
    """Part of a circle as the profile of a lathe, between two angles above the horizontal [rad]."""
    angles = np.linspace(first, last, steps + 1)
    across = np.where(np.isclose(np.abs(angles), np.pi / 2.0), 0.0, radius * np.cos(angles))
    return [(float(r), float(radius * np.sin(a))) for r, a in zip(across, angles, strict=True)]


def _cube(grid: Floats, half: Floats, radius: float) -> Solid:
    """A box of six faces, rounded by a radius [m]. grid: lines on each face; -1 and 1 are its edges, 0 the start of the
    rounding."""
    count = len(grid)
    side = np.sign(grid + np.linspace(-1e-9, 1e-9, count))
    first, second = (each.ravel() for each in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    corner = np.arange(count - 1)
    quad = (corner[:, None] * count + corner[None]).reshape(-1, 1)
    face = np.concatenate([quad + np.array(step) for step in ([0, count, count + 1], [0, count + 1, 1])])
    vertices: list[Floats] = []
    normals: list[Floats] = []
    triangles: list[npt.NDArray[Any]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            a, b = (axis + 1) % 3, (axis + 2) % 3
            signs, parts = np.empty((count * count, 3)), np.empty((count * count, 3))
            signs[:, axis], signs[:, a], signs[:, b] = sign, side[first], side[second]
            parts[:, axis], parts[:, a], parts[:, b] = sign, grid[first], grid[second]
            flat = np.zeros_like(parts)
            flat[:, axis] = sign
            lean = parts / np.linalg.norm(parts, axis=1, keepdims=True) if radius else flat
            vertices.append(signs * (half - radius) + radius * lean)
            normals.append(lean)
            triangles.append((face if sign > 0.0 else face[:, ::-1]) + len(triangles) * count * count)
    return _solid(np.concatenate(vertices), np.concatenate(normals), np.concatenate(triangles))


def _swept(rows: Floats, circle: Floats) -> Floats:
    """Points (k * n, 3) of profile points (radius, z) (k, 2) rotated around a circle (n, 2)."""
    around = rows[:, None, :1] * circle[None]
    return np.concatenate([around, np.broadcast_to(rows[:, None, 1:], (len(rows), len(circle), 1))], 2).reshape(-1, 3)


def _solid(vertices: Floats, normals: Floats, triangles: npt.NDArray[Any]) -> Solid:
    return Solid(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        triangles.astype(np.int32),
        np.full((len(vertices), 3), 0.8, dtype=np.float32),
        np.full(len(vertices), 0.5, dtype=np.float32),
    )
