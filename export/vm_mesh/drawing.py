"""Drawings of a mesh: from above, by direction, or on a camera's picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shapes import Cylinder
from vm_embedded.mesh.mesh import Mesh
from vm_workstation.plots import new_figure

from .built_mesh import BuiltMesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _POINT, _OBJECT = "#4c72b0", "#22304a", "#d95f02"
_MOST_LINKS = 200_000


def figure_from_above(built: BuiltMesh, view: str, reach: float, objects: tuple[float, ...] = ()) -> Figure:
    """A figure of the mesh out to `reach` [m], with outlines of objects at some distances [m].

    view: "ground" is from above: each point is where its ray meets the height of the objects' centers (for cylinders,
    the plane). "directions" has straight below in the middle; a point's angle around the middle is its bearing, and its
    distance from the middle is its inclination from straight below. It has room for points above the horizon.

    The paper's fig:mesh_distance shows such rings.
    """
    figure = new_figure(7.0, 7.2)
    axes = figure.subplots()
    draw_mesh(axes, built, view, reach, objects)
    plan = built.plan
    figure.suptitle(
        f"{built.model}, k = {plan.intersections:g}, camera {plan.height:g} m high, {len(built.mesh)} points to "
        f"{plan.max_distance:g} m",
        fontsize=10,
    )
    return figure


def draw_mesh(axes: Axes, built: BuiltMesh, view: str, reach: float, objects: tuple[float, ...] = ()) -> None:
    """Draw links, points and objects of a mesh into axes, as in `figure_from_above`."""
    plan = built.plan
    places = _places(built.mesh.rays, built, view)
    near = np.flatnonzero(built.distances <= reach)
    _draw_links(axes, built.mesh, places, near)
    axes.plot(*places[near].T, ".", color=_POINT, markersize=1.6 if len(near) < 6000 else 0.7)
    step = 2.0 * np.pi / max(len(objects), 1)
    for number, distance in enumerate(objects):
        bearing = 0.5 + number * step
        z = plan.shape.center_height - plan.height
        center = np.array([distance * np.cos(bearing), distance * np.sin(bearing), z])
        outline = _places(plan.shape.outline(center, plan.height, 120), built, view)
        axes.fill(*outline.T, facecolor=_OBJECT, alpha=0.25, edgecolor=_OBJECT, linewidth=1.2)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)
    if view == "ground":
        axes.set_xlabel("ahead [m]")
        axes.set_ylabel("left [m]")
    else:
        axes.set_xlabel("degrees from straight below; the circle is the horizon")
        around = np.linspace(0.0, 2.0 * np.pi, 361)
        axes.plot(90.0 * np.cos(around), 90.0 * np.sin(around), color="#999999", linewidth=0.8, linestyle="--")


def figure_on_picture(built: BuiltMesh, image: Image, lens: Lens, orientation: Orientation) -> Figure:
    """A figure of the mesh on a BGR picture (height, width, 3) from a camera with this lens and orientation.

    The paper's fig:mesh_projection shows such a picture.
    Raises InputError if the camera sees no point of the mesh.
    """
    size = image.shape[1], image.shape[0]
    shown = project(built.mesh, orientation.level, lens.for_image(size), size)
    seen = np.flatnonzero(shown.on_screen)
    if len(seen) == 0:
        raise InputError("the camera sees no point of the mesh; check --pitch, --height and --max-distance")
    width = 10.0
    figure = new_figure(width, width * size[1] / size[0])
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image[:, :, ::-1], extent=(-0.5, size[0] - 0.5, size[1] - 0.5, -0.5))
    _draw_links(axes, built.mesh, shown.pixels, seen, color="#ffffff", alpha=0.35)
    axes.plot(*shown.pixels[seen].T, ".", color="#ffe14d", markersize=1.8, markeredgewidth=0.0)
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    axes.axis("off")
    return figure


def _places(rays: Floats, built: BuiltMesh, view: str) -> Floats:
    """Places (n, 2) of rays (n, 3) in a view."""
    if view == "directions":
        inclination = np.degrees(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]))
        bearing = np.arctan2(rays[:, 1], rays[:, 0])
        return np.stack([inclination * np.cos(bearing), inclination * np.sin(bearing)], axis=1)
    if built.model == "wall6":
        raise InputError("view ground has no place for the points of wall6 above the horizon; give --view directions")
    shape = built.plan.shape
    height = built.plan.height - (0.0 if isinstance(shape, Cylinder) else shape.center_height)
    return np.asarray(rays[:, :2] * (height / np.maximum(-rays[:, 2:], 1e-9)))


def _draw_links(
    axes: Axes, mesh: Mesh, places: Floats, points: np.ndarray, color: str = _INK, alpha: float = 0.5
) -> None:
    """Draw the links among some of the points of a mesh, at their places (n, 2)."""
    from matplotlib.collections import LineCollection

    kept = np.zeros(len(mesh) + 1, dtype=bool)
    kept[points] = True
    start = np.repeat(points, mesh.neighbors.shape[1])
    end = mesh.neighbors[points].ravel()
    both = kept[end]
    pairs = np.unique(np.sort(np.stack([start[both], end[both]], axis=1), axis=1), axis=0)
    if len(pairs) > _MOST_LINKS:
        return  # too many to see one
    axes.add_collection(LineCollection(list(places[pairs]), colors=color, linewidths=0.5, alpha=alpha, zorder=1))
    axes.autoscale_view()
