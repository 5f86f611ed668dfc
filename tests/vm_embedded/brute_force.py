"""Meshes point by point and rays one by one, straight from the formulas: slow, plain, none of the package's code."""

import functools
import math
from collections import deque

import numpy as np

from vm_embedded.geometry.shapes import Circle, Cylinder, Sphere

STEPS = {
    4: ((-1, 0), (0, 1), (1, 0), (0, -1)),
    6: ((-1, 0), (-1, 1), (0, 1), (1, 0), (1, -1), (0, -1)),
    8: ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)),
}
"""Columns and rows to each neighbor on a lattice, in their order."""


def center_height(shape):
    return {Circle: 0.0, Sphere: shape.radius, Cylinder: getattr(shape, "object_height", 0.0) / 2.0}[type(shape)]


def tangent(shape, n, height):
    """tan(phi), n objects out; an odd function of n."""
    r = shape.radius
    if isinstance(shape, Sphere):
        return math.sinh(-n * math.log(1.0 - 2.0 * r / height))
    if isinstance(shape, Circle):
        return 2.0 * n * r / height
    top = shape.object_height
    growth = math.exp(-abs(n) * math.log(1.0 - top / height))
    return math.copysign(2.0 * r / top * (growth - 1.0), n)


def plain_rings(shape, height, k, max_distance):
    """phi and number of points of each ring, one formula after the other."""
    r = shape.radius
    rings = [(0.0, 1)]
    for i in range(1, 10**6):
        n = i / k
        slope = tangent(shape, n, height)
        if not height * slope < max_distance:
            return rings
        if isinstance(shape, Cylinder):
            axis = r + height * tangent(shape, n - 0.5, height)
        else:
            axis = (height - center_height(shape)) * slope
        theta = 2.0 * math.pi / (1.0 + 2.0 * n) if n <= 0.5 else 2.0 * math.asin(r / axis)
        rings.append((math.atan(slope), math.ceil(k * 2.0 * math.pi / theta - 1e-9)))
    raise AssertionError("rings without end")


def plain_mesh(shape, height, k, max_distance, width):
    """Rays and neighbors of the ring mesh with so many neighbors, point by point."""
    rings = plain_rings(shape, height, k, max_distance)
    starts = [0]
    for _, count in rings:
        starts.append(starts[-1] + count)
    missing = starts[-1]
    rays, rows = [], []
    for i, (phi, count) in enumerate(rings):
        has_next = i + 1 < len(rings)
        after = rings[i + 1][1] if has_next else 1
        before = rings[i - 1][1]
        for j in range(count):
            t = 2.0 * math.pi * j / count
            rays.append((math.cos(t) * math.sin(phi), math.sin(t) * math.sin(phi), -math.cos(phi)))
            if i == 0:
                rows.append([1 + int(m * after / width) if has_next else missing for m in range(width)])
                continue
            f = j / count

            def outwards(position, i=i, after=after, has_next=has_next):
                return starts[i + 1] + position % after if has_next else missing

            def inwards(position, i=i, before=before):
                return starts[i - 1] + position % before

            left, right = starts[i] + (j - 1) % count, starts[i] + (j + 1) % count
            top, bottom = outwards(math.floor(f * after + 0.5)), inwards(math.floor(f * before + 0.5))
            top_left, top_right = outwards(int(f * after)), outwards(int(f * after) + 1)
            bottom_left, bottom_right = inwards(int(f * before)), inwards(int(f * before) + 1)
            rows.append(
                {
                    4: [left, top, right, bottom],
                    6: [left, top_left, top_right, right, bottom_right, bottom_left],
                    8: [left, top_left, top, top_right, right, bottom_right, bottom, bottom_left],
                }[width]
            )
    rows.append([missing] * width)
    return np.array(rays), np.array(rows)


@functools.lru_cache(maxsize=10**6)
def plain_quarter(kind, shape, height, u, v):
    """x and y [m] at the height of the object's center of the point u and v objects out, both from 0."""
    c = center_height(shape)

    def slice_x(y):
        """x in the slice through the camera that is y away."""
        slant = math.sqrt((height - c) ** 2 + y**2)
        return slant * tangent(shape, u, slant + c)

    def slice_y(x):
        slant = math.sqrt((height - c) ** 2 + x**2)
        return slant * tangent(shape, v, slant + c)

    if kind == "xy":
        return slice_x(0.0), slice_y(0.0)
    if kind == "xm":
        x = slice_x(0.0)
        along = (height - c) / math.cos(math.atan2(x, height - c))
        return x, along * tangent(shape, v, along + c)
    # A slice that is farther away has its n-th object less far out, so the root lies below that of the nearest one.
    low, high = 0.0, slice_x(0.0)
    while high - low > 1e-13 * (height + high):
        x = 0.5 * (low + high)
        low, high = (x, high) if slice_x(slice_y(x)) > x else (low, x)
    return high, slice_y(high)


def plain_position(kind, shape, height, k, width, cell):
    """Coordinates x and y [m] at the height of the object's center of a lattice's cell (column, row)."""
    n, m = cell
    u, v = ((n + m / 2.0) / k, math.sqrt(3.0) / 2.0 * m / k) if width == 6 else (n / k, m / k)
    x, y = plain_quarter(kind, shape, height, abs(u), abs(v))
    return math.copysign(x, u), math.copysign(y, v)


def plain_grid(kind, shape, height, k, max_distance, width):
    """Coordinates (x, y) [m] of each cell (column, row) of the lattice: a flood fill from (0, 0)."""
    found, queue = {(0, 0): (0.0, 0.0)}, deque([(0, 0)])
    while queue:
        n, m = queue.popleft()
        for right, up in STEPS[width]:
            cell = (n + right, m + up)
            if cell not in found:
                x, y = plain_position(kind, shape, height, k, width, cell)
                if math.hypot(x, y) <= max_distance:
                    found[cell] = (x, y)
                    queue.append(cell)
    return found


def reached(mesh):
    """Which points (n,) one comes to from the first, or the one straight below, link by link."""
    start = int(np.argmin(mesh.rays[:, 2]))
    known = np.zeros(len(mesh) + 1, dtype=bool)
    front = np.array([start])
    while len(front):
        known[front] = True
        ahead = np.unique(mesh.neighbors[front])
        front = ahead[~known[ahead] & (ahead < len(mesh))]
    return known[:-1]


def hits(shape, rays, center, height):
    """Which rays (n, 3) from a camera `height` over the plane hit an object on it at `center` (x, y): a ray tracer."""
    x, y = center
    dx, dy, dz = rays.T
    if isinstance(shape, Sphere):
        to = np.array([x, y, shape.radius - height])
        along = rays @ to
        return (along > 0.0) & (along**2 >= to @ to - shape.radius**2)

    def on_level(z):
        """Rays that come to a level disk z over the plane."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (z - height) / dz
            return (t > 0.0) & (np.hypot(t * dx - x, t * dy - y) <= shape.radius)

    if isinstance(shape, Circle):
        return on_level(0.0)
    a, b, c = dx**2 + dy**2, x * dx + y * dy, x**2 + y**2 - shape.radius**2
    hit = on_level(0.0) | on_level(shape.object_height)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b**2 - a * c)
        for t in ((b - root) / a, (b + root) / a):
            z = height + t * dz
            hit |= (t > 0.0) & (z >= 0.0) & (z <= shape.object_height)
    return hit
