"""The figure of points on a ball over its distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.detection.projection import project
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import build_mesh
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.plots import new_figure

from ..data.classes import Classes
from ..data.pictures import read_picture
from ..graphs.hexagonal import HexagonalMesh, visible_hexagonal_mesh
from .evaluation import CameraPose
from .points_on_ball import BEARINGS, PosedCamera, points_on_ball, rings_across, rows_across, shown_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST = 0.5  # points or rings at the lower end of the axes
_DISTANCES = np.linspace(0.0, 10.0, 51)  # [m]
_COLORS = {3: "#1b9e77", 4: "#d95f02", 5: "#7570b3"}
_STYLES = {"visual": "-", "hexagonal": "--"}
_NAMES = {"visual": "Visual Mesh", "hexagonal": "hexagonal mesh"}


def points_figure(curves: Sequence[Curve], title: str = "") -> Figure:
    """Points on the ball on the left, rings or rows across it on the right.

    The left half is the paper's fig:ball_distance_graph. Raises InputError without matplotlib.
    """
    figure = new_figure(11.0, 5.4)
    from matplotlib.lines import Line2D

    points, rings = figure.subplots(1, 2)
    for curve in curves:
        look: dict[str, Any] = {"color": _color(curve), "linestyle": _STYLES[curve.mesh], "linewidth": 1.2}
        points.plot(curve.distances, curve.mean, **look)
        rings.plot(curve.distances, curve.rings, **look)
        low = np.maximum(curve.low, _LEAST)
        points.fill_between(curve.distances, low, curve.high, color=_color(curve), alpha=0.13, linewidth=0)
    points.set_ylabel("points on the ball: mean, and range over bearings")
    rings.set_ylabel("rings or rows across the ball, mean over bearings")
    for axes, ticks in ((points, (1, 2, 5, 10, 20, 50, 100, 200, 500)), (rings, (1, 2, 3, 4, 5, 6, 8, 10, 15, 20))):
        axes.set_yscale("log")
        axes.set_yticks(ticks, labels=[str(tick) for tick in ticks])
        axes.minorticks_off()
        axes.set_xlabel("distance of the ball [m]")
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=_LEAST)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    styles: list[dict[str, Any]] = [{"linestyle": _STYLES[mesh], "label": name} for mesh, name in _NAMES.items()]
    keys = [Line2D([], [], color="black", **style) for style in styles]
    colors = {f"k = {curve.intersections:g}": _color(curve) for curve in curves}
    keys += [Line2D([], [], color=color, linewidth=4.0, label=name) for name, color in colors.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=10)
    return figure


def median_camera_figure(
    poses: Sequence[CameraPose], classes: Classes, manifest: Manifest, grid: Grid
) -> tuple[Figure | None, str]:
    """The figure for a network's ball and the typical camera of the data, and a text that describes both.

    The typical camera is that of the picture nearest to the medians of height and pitch. There is at least one pose.
    If the network's objects are not balls, or the camera sees no ball, there is no figure, and the text says why.
    """
    if manifest.shape != "sphere":
        return None, f"The figure is for balls, but the network's objects are of shape {manifest.shape}."
    radius = manifest.object_radius
    values = np.array([(each.height, each.pitch) for each in poses])
    spread = np.maximum(values.std(axis=0), 1e-9)
    nearest = np.linalg.norm((values - np.median(values, axis=0)) / spread, axis=1).argmin()
    pose = poses[int(nearest)]
    picture = read_picture(pose.files, classes)
    camera = PosedCamera(picture.orientation, picture.lens.lens, picture.size)
    text = (
        f"Camera of {pose.files.image.name}, the nearest to the median: {pose.height:.2f} m high, "
        f"{np.degrees(pose.pitch):.0f} degrees down. Ball of radius {radius:g} m."
    )
    try:
        curves = points_over_distance(camera, Sphere(radius), (3, 4, 5), _DISTANCES, grid.equal_at or None)
    except (InputError, GeometryError) as error:
        return None, f"{text} No figure: {error}."
    return points_figure(curves), text


def _color(curve: Curve) -> str:
    return _COLORS.get(round(curve.intersections), "#444444")


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
