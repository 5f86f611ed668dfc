"""Plots of vm-mesh: points on an object, and pixels on it, over its distance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from vm_workstation.plots import new_figure

from .built_mesh import MeshPlan
from .quality import PointsOnObject
from .useful_range import UsefulRange

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLORS = ("#4c72b0", "#d95f02", "#1b9e77", "#c44e52", "#7570b3", "#937860", "#e7298a", "#8c8c8c", "#66a61e", "#17becf")


def quality_figure(plan: MeshPlan, curves: Mapping[str, PointsOnObject]) -> Figure:
    """The equivalent k over distance for each model: the mean as a line, and the range over bearings."""
    figure = new_figure(9.0, 4.6)
    axes = figure.subplots()
    k = plan.intersections
    axes.axhspan(k - 1.0, k + 1.0, color="#dddddd", alpha=0.5, linewidth=0)
    axes.axhline(k, color="#999999", linewidth=0.8)
    for number, (model, curve) in enumerate(curves.items()):
        color = _COLORS[number % len(_COLORS)]
        style = ("-", "--", ":")[number // len(_COLORS) % 3]
        axes.plot(curve.distances, curve.mean, style, color=color, linewidth=1.3, label=model)
        if len(curves) <= 4:  # more of them are hard to tell from each other
            axes.fill_between(curve.distances, curve.low, curve.high, color=color, alpha=0.15, linewidth=0)
    axes.set_xlabel("distance of the object from the camera's foot [m]")
    axes.set_ylabel("equivalent k: mean, and range over bearings")
    axes.set_title(f"k = {k:g}, and one more or less; camera {plan.height:g} m high; {plan.shape}", fontsize=9)
    axes.set_ylim(0.0, 2.5 * k)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside right center", frameon=False, fontsize=9)
    return figure


def range_figure(plan: MeshPlan, found: UsefulRange) -> Figure:
    """Pixels across an object and per step of the mesh, over distance."""
    figure = new_figure(9.0, 4.2)
    axes = figure.subplots()
    axes.loglog(found.distances, found.pixels[:, 0], color=_COLORS[0], label="pixels across the object")
    narrow = found.pixels.min(axis=1)
    axes.loglog(found.distances, narrow / plan.intersections, color=_COLORS[1], label="pixels per mesh step")
    axes.axhline(1.0, color="#999999", linewidth=0.8)
    if found.distances[0] < found.limit < found.distances[-1]:
        axes.axvline(found.limit, color=_COLORS[3], linewidth=1.0, linestyle="--", label=f"{found.limit:.1f} m")
    axes.set_xlabel("distance of the object from the camera's foot [m]")
    axes.set_ylabel("[px]")
    axes.grid(alpha=0.25, which="both")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
    return figure
