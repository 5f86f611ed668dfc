"""Colors, axes and legends that the plots of points and of objects share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vm_embedded.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS = ("#d62728", "#1f77b4", "#2ca02c", "#7f7f7f", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#e377c2", "#bcbd22")
_LINES = ("-", "--", ":")
FEWEST = 10
"""Objects that a bin needs to be drawn; the scores of fewer depend on chance."""

_MOST = 300  # points of a long curve


def colors(count: int) -> list[str]:
    """Colors of lines, repeated after ten."""
    return [_COLORS[number % len(_COLORS)] for number in range(count)]


def line_styles(count: int) -> list[str]:
    """Styles of lines, repeated after three."""
    return [_LINES[number % len(_LINES)] for number in range(count)]


def bin_middles(edges: Floats) -> Floats:
    """Middles (D,) of bins with edges (D + 1,)."""
    return np.asarray((edges[:-1] + edges[1:]) / 2.0)


def thinned(values: Floats) -> Floats:
    """About 300 of the values, evenly spaced, with the first and the last."""
    return values[np.unique(np.linspace(0, len(values) - 1, _MOST).astype(int))] if len(values) else values


def label_axes(axes: Axes, x: str, y: str) -> None:
    """Labels, a light grid, and no frame at the top and the right."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def unit_square(axes: Axes, x: str, y: str) -> None:
    """Axes of two shares from 0 to 1, with a legend."""
    label_axes(axes, x, y)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.02)
    add_legend(axes)


def distance_axis(axes: Axes, edges: Floats, counts: Sequence[int]) -> None:
    """A horizontal axis of distance bins with edges (D + 1,) [m], up to the last bin that is not empty.

    counts (D,): what is in each bin.
    """
    label_axes(axes, "distance [m]", "")
    used = np.flatnonzero(counts)
    axes.set_xlim(float(edges[0]), float(edges[used[-1] + 1 if len(used) else -1]))


def add_legend(axes: Axes) -> None:
    """A legend of the axes' lines, if any has a label."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False)


def shared_legend(figure: Figure, panels: Sequence[Axes], columns: int) -> None:
    """One legend below all panels, which have the same lines."""
    keys, names = panels[0].get_legend_handles_labels()
    figure.legend(keys, names, loc="outside lower center", ncols=min(len(names), columns), fontsize=9, frameon=False)
