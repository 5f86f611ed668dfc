"""Points of both meshes on a ball, over its distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import build_mesh

from ..graphs.hexagonal import HexagonalMesh, visible_hexagonal_mesh
from .points_on_ball import BEARINGS, PosedCamera, points_on_ball, rings_across, rows_across, shown_whole

_MAX_DISTANCE = 20.0
"""Reach of the Visual Mesh [m], as in the reference implementation."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of one mesh on a ball, over the ball's distance.

    mesh: visual, our rings; or hexagonal, the baseline. intersections: k of the Visual Mesh; a hexagonal mesh has the
    k of the Visual Mesh that it is compared to. count: points on screen. distances (m,) [m]: on the plane, from below
    the camera to below the ball's center. mean, low, high (m,): points on the ball over all bearings, NaN where the
    camera sees no complete ball. rings (m,): rings of the Visual Mesh across the ball, or rows of the hexagonal mesh,
    averaged over all bearings.
    """

    mesh: str
    intersections: float
    count: int
    distances: Floats
    mean: Floats
    low: Floats
    high: Floats
    rings: Floats


def points_over_distance(
    camera: PosedCamera,
    ball: Sphere,
    intersections: Sequence[float],
    distances: Floats,
    equal_at: float | None = None,
) -> list[Curve]:
    """Curves of the Visual Mesh and of the hexagonal mesh for each of the intersections, at distances (m,) [m].

    The paper's fig:ball_distance_graph has such curves. The hexagonal mesh has as many points on screen as the Visual
    Mesh or, with `equal_at` [m], as many points on a ball at that distance. Raises GeometryError if the camera is too
    low for the ball, and InputError if the camera sees no point of the mesh, or no ball at `equal_at`.
    """
    camera = PosedCamera(camera.orientation, camera.lens.for_image(camera.size), camera.size)
    seen = [(distance, BEARINGS[shown_whole(camera, ball, distance, BEARINGS)]) for distance in distances.tolist()]
    curves = []
    for k in intersections:
        mesh = _rings_on_screen(camera, ball, k)
        curves.append(_ring_curve(mesh, camera, ball, k, seen))
        count = len(mesh) if equal_at is None else _equal_count(mesh, camera, ball, equal_at)
        hexagonal = visible_hexagonal_mesh(camera.lens, camera.size, count)
        curves.append(_hexagonal_curve(hexagonal, camera, ball, k, seen))
    return curves


def _rings_on_screen(camera: PosedCamera, ball: Sphere, intersections: float) -> Mesh:
    mesh = build_mesh(ball, camera.orientation.height, intersections, _MAX_DISTANCE)
    visible = project(mesh, camera.orientation.level, camera.lens, camera.size).visible.graph
    if len(visible) == 0:
        raise InputError("the camera sees no point of the Visual Mesh")
    return visible


def _hexagonal_rays(mesh: HexagonalMesh, camera: PosedCamera) -> Floats:
    """Rays (n, 3) of the points, in the observation-plane frame."""
    return np.asarray(camera.lens.unproject(mesh.pixels, camera.size) @ camera.orientation.level.T)


_Seen = Sequence[tuple[float, Floats]]
"""Distances [m], each with the bearings [rad] at which the camera sees the complete ball."""


def _ring_curve(mesh: Mesh, camera: PosedCamera, ball: Sphere, intersections: float, seen: _Seen) -> Curve:
    height = camera.orientation.height
    rings = [rings_across(mesh, ball, height, distance) for distance, _ in seen]
    return _curve("visual", mesh.rays, rings, height, ball, intersections, seen)


def _hexagonal_curve(
    mesh: HexagonalMesh, camera: PosedCamera, ball: Sphere, intersections: float, seen: _Seen
) -> Curve:
    rows = [
        float(rows_across(mesh, camera, ball, distance, bearings).mean()) if len(bearings) else math.nan
        for distance, bearings in seen
    ]
    rays = _hexagonal_rays(mesh, camera)
    return _curve("hexagonal", rays, rows, camera.orientation.height, ball, intersections, seen)


def _curve(
    kind: str, rays: Floats, rings: Sequence[float], height: float, ball: Sphere, intersections: float, seen: _Seen
) -> Curve:
    rows = np.full((3, len(seen)), np.nan)
    for column, (distance, bearings) in enumerate(seen):
        if len(bearings):
            counts = points_on_ball(rays, ball, height, distance, bearings)
            rows[:, column] = counts.mean(), counts.min(), counts.max()
    crossed = np.where(np.isnan(rows[0]), np.nan, np.array(rings, dtype=np.float64))
    distances = np.array([distance for distance, _ in seen])
    return Curve(kind, intersections, len(rays), distances, rows[0], rows[1], rows[2], crossed)


def _equal_count(mesh: Mesh, camera: PosedCamera, ball: Sphere, distance: float) -> int:
    """Size of the hexagonal mesh with as many points as `mesh` on a ball at about this distance [m]."""
    hexagonal = visible_hexagonal_mesh(camera.lens, camera.size, len(mesh))
    totals = np.zeros(2)
    for near in (distance * np.linspace(0.9, 1.1, 9)).tolist():
        bearings = BEARINGS[shown_whole(camera, ball, near, BEARINGS)]
        for which, rays in enumerate((mesh.rays, _hexagonal_rays(hexagonal, camera))):
            totals[which] += points_on_ball(rays, ball, camera.orientation.height, near, bearings).sum()
    if not totals.all():
        raise InputError(f"the camera sees no complete ball at {distance:g} m")
    return round(len(hexagonal) * float(totals[0] / totals[1]))
