"""The paper's figure `ball_distance_graph`: points on a ball over its distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_workstation.plots import new_figure

from .points_on_ball import Curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST = 0.5  # number of points or rings that is drawn
_COLORS = {3: "#1b9e77", 4: "#d95f02", 5: "#7570b3"}
_STYLES = {"visual": "-", "hexagonal": "--", "early": ":"}
_NAMES = {"visual": "Visual Mesh", "hexagonal": "hexagonal mesh", "early": "Visual Mesh, early widths"}


def points_figure(curves: Sequence[Curve], title: str = "") -> Figure:
    """Points on the ball at the left, rings or rows across it at the right. Raises InputError without matplotlib."""
    figure = new_figure(11.0, 5.4)
    from matplotlib.lines import Line2D

    points, rings = figure.subplots(1, 2)
    for curve in curves:
        look: dict[str, Any] = {"color": _color(curve), "linestyle": _STYLES[curve.mesh], "linewidth": 1.2}
        points.plot(curve.distances, curve.mean, **look)
        if curve.mesh != "early":  # its rings are ours, and its range would hide the others'
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
    present = {curve.mesh: None for curve in curves}
    styles: list[dict[str, Any]] = [{"linestyle": _STYLES[mesh], "label": _NAMES[mesh]} for mesh in present]
    keys = [Line2D([], [], color="black", **style) for style in styles]
    colors = {f"k = {curve.intersections:g}": _color(curve) for curve in curves}
    keys += [Line2D([], [], color=color, linewidth=4.0, label=name) for name, color in colors.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=10)
    return figure


def _color(curve: Curve) -> str:
    return _COLORS.get(round(curve.intersections), "#444444")
