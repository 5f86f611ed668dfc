"""Number of mesh points, rings and rows on a ball in view of a camera.

The paper: it varies by at most 1 in phi and theta (section "Graph Structure of the Mesh").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, frozen
from vm_embedded.detection.projection import project
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.mesh import Mesh

from ..graphs.hexagonal import HexagonalMesh

BEARINGS: Floats = frozen(math.radians(25.0) * (2.0 * (np.arange(64) * (math.sqrt(5.0) - 1.0) / 2.0 % 1.0) - 1.0))
"""Bearings of the balls [rad], 0 ahead of the camera: evenly spread, and out of step with the points of any ring."""


@dataclass(frozen=True)
class PosedCamera:
    """A camera on the plane: height and attitude, lens, and size of the picture [px]."""

    orientation: Orientation
    lens: Lens
    size: Size


def centers(ball: Sphere, height: float, distance: float, bearings: Floats) -> Floats:
    """Centers (m, 3) [m], relative to the camera, of balls at a distance [m] on the plane and bearings (m,) [rad].

    height: of the camera [m]. The frame is that of the observation plane.
    """
    z = np.full(len(bearings), ball.center_height - height)
    return np.stack([distance * np.cos(bearings), distance * np.sin(bearings), z], axis=1)


def points_on_ball(
    rays: Floats, ball: Sphere, height: float, distance: float, bearings: Floats = BEARINGS
) -> npt.NDArray[np.int64]:
    """Number of unit rays (n, 3) that hit each of the balls at a distance [m] and bearings (m,) [rad]: (m,).

    A ray hits a ball if it lies inside the cone around the ball. Rays are in the observation-plane frame; rays with NaN
    hit nothing. height: of the camera [m].
    """
    near, far = _inclinations(ball, height, distance)
    down = -rays[:, 2]  # only rays in the ball's band of inclination can hit it
    band = rays[(down >= math.cos(far) - 1e-9) & (down <= math.cos(max(near, 0.0)) + 1e-9)]
    hits = ball.offset(band, centers(ball, height, distance, bearings), height) < 1.0
    return np.asarray(np.count_nonzero(hits, axis=1))


def rings_across(mesh: Mesh, ball: Sphere, height: float, distance: float) -> int:
    """Number of rings that cross a ball at a distance [m], counted along the line from the camera's foot to the ball.

    A ring counts twice if the ball covers it on both sides of the camera's foot.
    """
    near, far = _inclinations(ball, height, distance)
    phi = np.arctan2(np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]), -mesh.rays[:, 2])
    rings = phi[np.append(True, np.diff(phi) > 1e-9)]
    beyond = -rings[rings > 0.0]  # the nadir counts once
    return int(np.count_nonzero((rings > near) & (rings < far)) + np.count_nonzero((beyond > near) & (beyond < far)))


def rows_across(mesh: HexagonalMesh, camera: PosedCamera, ball: Sphere, distance: float, bearings: Floats) -> Floats:
    """Number of rows that cross each of the balls at a distance [m] and bearings (m,) [rad]: (m,)."""
    rows = np.unique(mesh.pixels[:, 1])
    height = camera.orientation.height
    counts = []
    for center in centers(ball, height, distance, bearings):
        y = _projected(ball.outline(center, height), camera)[0][:, 1]
        counts.append(np.count_nonzero((rows > y.min()) & (rows < y.max())))
    return np.array(counts, dtype=np.float64)


def shown_whole(camera: PosedCamera, ball: Sphere, distance: float, bearings: Floats) -> Mask:
    """Which of the balls (m,) at a distance [m] and bearings (m,) [rad] lie completely inside the picture."""
    height = camera.orientation.height
    outlines = [ball.outline(center, height) for center in centers(ball, height, distance, bearings)]
    return np.array([_projected(outline, camera)[1].all() for outline in outlines], dtype=bool)


def _inclinations(ball: Sphere, height: float, distance: float) -> tuple[float, float]:
    """Inclinations of the near and the far side of a ball [rad]; the near one is negative behind the camera's foot."""
    below = height - ball.center_height
    middle = math.atan2(distance, below)
    half = math.asin(ball.radius / math.hypot(distance, below))
    return middle - half, middle + half


def _projected(rays: Floats, camera: PosedCamera) -> tuple[Floats, Mask]:
    """Pixels (n, 2) of rays (n, 3) in the observation-plane frame, and which of them are on screen (n,)."""
    alone = Mesh(rays, np.empty((len(rays) + 1, 0), dtype=np.int32))
    projection = project(alone, camera.orientation.level, camera.lens, camera.size)
    return projection.pixels, projection.on_screen
