"""The figure of points on a ball over its distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_embedded.errors import GeometryError, InputError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.plots import new_figure

from ..data.classes import Classes
from ..data.pictures import read_picture
from .evaluation import CameraPose
from .points_on_ball import PosedCamera
from .points_over_distance import Curve, points_over_distance

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
