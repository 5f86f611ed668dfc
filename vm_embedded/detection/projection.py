"""From the mesh to the picture: the pixels of the points, and whether they are on screen.

The paper projects the points of the mesh in the same way (section "Graph Structure of the Mesh").
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..arrays import Chosen, Floats, Mask
from ..geometry.lens import Lens, Size
from ..mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Projection:
    """The n points of a mesh, their pixels (n, 2), and a mask of those that are on_screen (n,).

    Pixels of points off screen have no meaning.
    """

    graph: Mesh
    pixels: Floats
    on_screen: Mask

    def __len__(self) -> int:
        return len(self.graph)

    @property
    def visible(self) -> Projection:
        """The points that are on screen."""
        kept = np.flatnonzero(self.on_screen)
        return Projection(self.graph.part(kept), self.pixels[kept], self.on_screen[kept])

    @cached_property
    def core(self) -> Mask:
        """Which points (n,) are on screen and not in the margin of the mesh."""
        return self.on_screen if self.graph.margin is None else self.on_screen & ~self.graph.margin

    @cached_property
    def answered(self) -> Chosen:
        """The points (k,) of the core."""
        return np.flatnonzero(self.core)

    def only(self, chosen: Mask) -> Projection:
        """The same mesh; points outside of `chosen` (n,) count as off screen."""
        return Projection(self.graph, self.pixels, self.on_screen & chosen)


def along(rays: Floats, direction: Floats) -> Floats:
    """Cosines (n,) between rays (n, 3) and a unit vector (3,).

    A matrix product would make numpy start threads on every core.
    """
    x, y, z = direction.tolist()
    cosines: Floats = rays[:, 0] * x
    cosines += rays[:, 1] * y
    cosines += rays[:, 2] * z
    return cosines


def to_camera(rays: Floats, rotation: Floats) -> Floats:
    """Rays (n, 3) in the camera frame, R^T ray, column by column in memory.

    The digits of a matrix product would depend on the number of rays; those of this sum don't.
    """
    camera = np.empty((3, len(rays)))
    term = np.empty(len(rays))
    for sums, (a, b, c) in zip(camera, rotation.T.tolist(), strict=True):
        np.multiply(rays[:, 0], a, out=sums)
        np.multiply(rays[:, 1], b, out=term)
        sums += term
        np.multiply(rays[:, 2], c, out=term)
        sums += term
    return camera.T


def project(mesh: Mesh, rotation: Floats, lens: Lens, size: Size) -> Projection:
    """Project a mesh's points into the picture.

    rotation (3, 3): camera to mesh frame. size: width and height [px]. A point is on screen if the lens sees it and all
    four pixels around it are in the picture: 0 <= x and x + 1 < width, and the same for y.
    """
    camera = to_camera(mesh.rays, rotation)
    pixels = lens.project(camera, size)
    return Projection(mesh, pixels, lens.sees(camera) & _inside(pixels, size, 0.0))


def may_be_on_screen(mesh: Mesh, rotation: Floats, lens: Lens, size: Size, slack: float) -> Mask:
    """The points (n,) that are on screen for a camera turned by up to `slack` [rad] from `rotation`.

    It may keep too many points, but never too few. A point outside of the lens's view is first moved to the edge of the
    view. A turn by `slack` moves a pixel by at most slack * `_pixels_per_radian`, or pi times as much if the view is
    wider than half a sphere. Points farther off the picture are left out.
    """
    reach = _view_angle(lens, size)
    ahead = along(mesh.rays, rotation[:, 0])  # cosine of the angle to the optical axis, the camera's x
    # A rotation matrix with rounding errors may shorten rays by up to 5e-4, and the lens compares a ray's x with a
    # cosine as if its length were 1. Twice as much is allowed here.
    near = np.flatnonzero(ahead > np.cos(min(reach + slack, np.pi)) - 1e-3)
    camera = to_camera(mesh.rays[near], rotation)
    cosine = np.maximum(camera[:, 0], np.cos(reach))
    sine = np.hypot(camera[:, 1], camera[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        inward = np.where(sine > 0, np.sqrt(1.0 - cosine * cosine) / sine, 0.0)
    camera[:, 1] *= inward
    camera[:, 2] *= inward
    camera[:, 0] = cosine
    # The bound needs a path inside of the view: from the point, which is moved to the edge if it is outside, to where
    # the turn brings it. In a view of at most half a sphere the great arc is such a path, and moving the point to the
    # edge makes it no longer. In a wider view the arc may pass behind the camera, and a path along the edge is at most
    # pi / 2 times as long; moving the point to the edge at most doubles that. Together: 2 pi / 2 = pi.
    detour = 1.0 if reach <= np.pi / 2 else np.pi
    margin = detour * slack * _pixels_per_radian(lens, size)
    possible = np.zeros(len(mesh), dtype=bool)
    possible[near] = _inside(lens.project(camera, size), size, margin)
    return possible


def _inside(pixels: Floats, size: Size, margin: float) -> Mask:
    inside = np.ones(len(pixels), dtype=bool)
    for axis in range(2):
        inside &= pixels[:, axis] >= -margin
        inside &= pixels[:, axis] < size[axis] - 1 + margin
    return inside


@lru_cache(maxsize=32)
def _view_angle(lens: Lens, size: Size) -> float:
    """Largest angle from the axis [rad] at which the lens reaches a pixel of the picture."""
    x, y = np.linspace(0.0, size[0] - 1.0, 65), np.linspace(0.0, size[1] - 1.0, 65)
    pixels = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)
    angles = np.arccos(np.clip(lens.unproject(pixels, size)[:, 0], -1.0, 1.0))
    if np.isnan(angles).any():  # the lens does not reach some pixel
        return lens.limit
    # The farthest pixel is on the border, at most half a step of the 64 from one that was looked at.
    return min(lens.limit, float(angles.max()) * 1.02)


@lru_cache(maxsize=32)
def _pixels_per_radian(lens: Lens, size: Size) -> float:
    """Largest shift of a pixel [px] for each radian that its ray turns, anywhere in the view."""
    reach = _view_angle(lens, size)
    # The angles end just before pi. Straight behind the camera sin(theta) is 0, and `sideways` has no limit.
    grid = np.meshgrid(np.linspace(1e-3, min(reach, np.pi - 1e-3), 200), np.linspace(0.0, 2.0 * np.pi, 33))
    theta, around = (axis.reshape(-1) for axis in grid)
    step = 1e-5

    def at(theta: Floats, around: Floats) -> Floats:
        rays = np.stack([np.cos(theta), np.sin(theta) * np.cos(around), np.sin(theta) * np.sin(around)], axis=1)
        return lens.project(rays, size)

    outward = np.linalg.norm(at(theta, around) - at(theta - step, around), axis=1) / step
    sideways = np.linalg.norm(at(theta, around + step) - at(theta, around), axis=1) / (step * np.sin(theta))
    # hypot covers a turn in both directions at once; the 2 % cover the gaps between the 200 angles.
    return 1.02 * float(np.hypot(outward, sideways).max())
