"""A mesh as a picture: from above, by direction, or in a camera's picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.detection.projection import project
from vm_embedded.errors import InputError
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.geometry.lens import Lens
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.mesh.mesh import Mesh
from vm_workstation.plots import new_figure

from .made_mesh import MadeMesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VIEWS = ("ground", "directions")
"""ground: where rays meet the height of the objects' centers, from above. directions: bearing around the middle, and
the inclination from straight below as the distance from it, so that points above the horizon have a place, too."""

_INK, _POINT, _OBJECT = "#4c72b0", "#22304a", "#d95f02"
_MOST_LINKS = 200_000


def drawn(made: MadeMesh, view: str, reach: float, objects: tuple[float, ...] = ()) -> Figure:
    """The mesh from above out to `reach` [m], with the outlines of objects at some distances [m].

    The paper's fig:mesh_distance shows such rings.
    """
    figure = new_figure(7.0, 7.2)
    axes = figure.subplots()
    draw_mesh(axes, made, view, reach, objects)
    plan = made.plan
    figure.suptitle(
        f"{made.model}, k = {plan.intersections:g}, camera {plan.height:g} m high, {len(made.mesh)} points to "
        f"{plan.max_distance:g} m",
        fontsize=10,
    )
    return figure


def draw_mesh(axes: Axes, made: MadeMesh, view: str, reach: float, objects: tuple[float, ...] = ()) -> None:
    """Draw links, points and objects of a mesh into axes; see `drawn`."""
    plan = made.plan
    places = _places(made.mesh.rays, made, view)
    near = np.flatnonzero(made.distances <= reach)
    _links(axes, made.mesh, places, near)
    axes.plot(*places[near].T, ".", color=_POINT, markersize=1.6 if len(near) < 6000 else 0.7)
    step = 2.0 * np.pi / max(len(objects), 1)
    for number, distance in enumerate(objects):
        bearing = 0.5 + number * step
        down = plan.shape.center_height - plan.height
        center = np.array([distance * np.cos(bearing), distance * np.sin(bearing), down])
        outline = _places(plan.shape.outline(center, plan.height, 120), made, view)
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


def on_picture(made: MadeMesh, image: Image, lens: Lens, orientation: Orientation) -> Figure:
    """The mesh in a BGR picture (height, width, 3) that a camera of that orientation took (paper: fig:mesh_projection).

    Raises InputError.
    """
    size = image.shape[1], image.shape[0]
    shown = project(made.mesh, orientation.level, lens.for_image(size), size)
    seen = np.flatnonzero(shown.on_screen)
    if len(seen) == 0:
        raise InputError("the camera sees no point of the mesh; it may look at the sky, or too far")
    width = 10.0
    figure = new_figure(width, width * size[1] / size[0])
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image[:, :, ::-1], extent=(-0.5, size[0] - 0.5, size[1] - 0.5, -0.5))
    _links(axes, made.mesh, shown.pixels, seen, color="#ffffff", alpha=0.35)
    axes.plot(*shown.pixels[seen].T, ".", color="#ffe14d", markersize=1.8, markeredgewidth=0.0)
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    axes.axis("off")
    return figure


def _places(rays: Floats, made: MadeMesh, view: str) -> Floats:
    """Where rays (n, 3) lie in a view (n, 2)."""
    if view == "directions":
        inclination = np.degrees(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]))
        bearing = np.arctan2(rays[:, 1], rays[:, 0])
        return np.stack([inclination * np.cos(bearing), inclination * np.sin(bearing)], axis=1)
    if made.model == "wall6":
        raise InputError("wall6 has points above the horizon, which the ground does not show; give --view directions")
    shape = made.plan.shape
    height = made.plan.height - (0.0 if isinstance(shape, Cylinder) else shape.center_height)
    return np.asarray(rays[:, :2] * (height / np.maximum(-rays[:, 2:], 1e-9)))


def _links(axes: Axes, mesh: Mesh, places: Floats, points: np.ndarray, color: str = _INK, alpha: float = 0.5) -> None:
    from matplotlib.collections import LineCollection

    kept = np.zeros(len(mesh) + 1, dtype=bool)
    kept[points] = True
    start = np.repeat(points, mesh.neighbors.shape[1])
    end = mesh.neighbors[points].ravel()
    both = kept[end]
    pairs = np.unique(np.sort(np.stack([start[both], end[both]], axis=1), axis=1), axis=0)
    if len(pairs) > _MOST_LINKS:
        return  # a carpet, in which nobody sees a link
    axes.add_collection(LineCollection(list(places[pairs]), colors=color, linewidths=0.5, alpha=alpha, zorder=1))
    axes.autoscale_view()
