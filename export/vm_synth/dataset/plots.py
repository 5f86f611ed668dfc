"""Histograms of a set of pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_embedded.errors import InputError, install_extra
from vm_embedded.files import atomic_write
from vm_embedded.geometry.lens import Size
from vm_workstation.plots import keep_dollar_signs

from ..scene.configuration import CLASSES
from .inspection import Facts
from .report import categories, object_name, objects_of, quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GREEN, _GRAY, _RED = "#2a7f62", "#9aa5b1", "#c0392b"
_CLASS_COLORS = {"ball": "#d62728", "goal": "#e3c000", "line": "#c9c9c9", "field": "#2ca02c", "robot": "#3355dd"}

_CAMERA = ("camera height [m]", "camera pitch [deg]", "camera roll [deg]")
_OBJECT = ("distance [m]", "radius [px]", "visible [%]")
_UNEVEN = ("roll [deg]", "visible [%]")  # plotted on a log scale
_MOST = 14  # largest number of bars
_DOT = 4000.0  # total area of all dots


def load_matplotlib(path: Path) -> Any:
    """Import matplotlib without a display. Raises InputError if it is missing or can't write files of this kind."""
    try:
        import matplotlib
    except ImportError as error:
        raise InputError(f"--plots needs matplotlib; {install_extra('synth')}") from error
    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    known = Figure().canvas.get_supported_filetypes()
    if path.suffix[1:].lower() not in known:
        raise InputError(f"can't write plots to {path}: its suffix must be one of {', '.join(sorted(known))}")
    return matplotlib


def plot(facts: Sequence[Facts], size: Size, title: str, path: Path) -> None:
    """Write histograms of pictures of this size (w, h) [px] to a file. Raises InputError if that fails."""
    load_matplotlib(path)
    from matplotlib import pyplot

    figure, grid = pyplot.subplots(3, 4, figsize=(14.0, 9.0), layout="constrained")
    figure.suptitle(title, fontsize=11)
    axes = list(grid.flat)
    designs = categories(facts).get("ball design", Counter[str]())
    values, kinds, shown_name = quantities(facts), categories(facts), object_name(facts)
    for each, name in zip(axes, (*_CAMERA, *(f"{shown_name} {what}" for what in _OBJECT)), strict=False):
        _histogram(each, values.get(name, []), name)
    _places(axes[6], facts, size)
    _shares(axes[7], values)
    for each, shown in ((axes[8], ("ground", "lens")), (axes[9], (shown_name, "other ball"))):
        _bars(each, {f"{what}: {name}": n for what in shown for name, n in kinds.get(what, {}).items()}, "pictures")
    _bars(axes[10], dict(designs.most_common(_MOST)), _titled("balls with a pattern", designs))
    _map_use(axes[11], sorted(kinds["map"].values(), reverse=True))
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
        each.tick_params(labelsize=8)
    keep_dollar_signs(figure)
    with atomic_write(path) as part:
        figure.savefig(part, dpi=110, format=path.suffix[1:].lower())
    pyplot.close(figure)


def _histogram(axes: Axes, values: Sequence[float], name: str) -> None:
    uneven = name.endswith(_UNEVEN)
    axes.set_xlabel(name, fontsize=9)
    axes.set_ylabel("pictures, log scale" if uneven else "pictures", fontsize=9)
    if not values:
        return _nothing(axes)
    # Balls at the edge of a rectilinear lens can be huge; they count in the last column.
    shown = np.minimum(values, np.quantile(values, 0.995) if name.endswith("radius [px]") else np.inf)
    axes.hist(shown, bins=40, color=_GREEN, log=uneven)
    median, (low, high) = float(np.median(values)), axes.get_xlim()
    axes.axvline(median, color=_RED, linewidth=1.0)
    side = "left" if median < (low + high) / 2.0 else "right"
    place = axes.get_xaxis_transform()
    axes.text(median, 1.0, f" median {median:.3g} ", color=_RED, fontsize=8, ha=side, transform=place)


def _places(axes: Axes, facts: Sequence[Facts], size: Size) -> None:
    shown = objects_of(facts)
    x, y = np.array([each.pixel for each in shown]).reshape(-1, 2).T
    axes.scatter(x, y, s=_DOT / max(len(shown), 1), color=_GREEN)
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{object_name(facts)} positions in the picture [px]", fontsize=9)


def _shares(axes: Axes, values: dict[str, list[float]]) -> None:
    axes.set_xlabel("pixels, mean over all pictures [%]", fontsize=9)
    means = {name: values.get(f"{name} pixels [%]", []) for name in (*CLASSES, "unlabeled")}
    if not all(means.values()):
        return _nothing(axes)
    heights = [float(np.mean(each)) for each in means.values()]
    bars = axes.barh(list(means), heights, color=[_CLASS_COLORS.get(name, _GRAY) for name in means])
    shown = [100.0 * float(np.mean(np.array(each) > 0.0)) for each in means.values()]
    labels = [f" {mean:.2g} %, in {share:.0f} % of the pictures" for mean, share in zip(heights, shown, strict=True)]
    axes.bar_label(bars, labels=labels, fontsize=7)
    axes.set_xlim(0.0, 1.9 * max(heights))
    axes.invert_yaxis()


def _bars(axes: Axes, counts: dict[str, int], label: str) -> None:
    axes.set_xlabel(label, fontsize=9)
    if not counts:
        return _nothing(axes)
    bars = axes.barh(list(counts), list(counts.values()), color=_GREEN)
    axes.bar_label(bars, labels=[f" {each}" for each in counts.values()], fontsize=7)
    axes.set_xlim(0.0, 1.15 * max(counts.values()))
    axes.invert_yaxis()


def _titled(label: str, counts: Counter[str]) -> str:
    return label if len(counts) <= _MOST else f"{label}, the {_MOST} most frequent of {len(counts)}"


def _map_use(axes: Axes, counts: Sequence[int]) -> None:
    axes.bar(range(1, len(counts) + 1), counts, width=1.0, color=_GREEN)
    axes.set_xlabel(f"{len(counts)} maps, sorted by use", fontsize=9)
    axes.set_ylabel("pictures", fontsize=9)


def _nothing(axes: Axes) -> None:
    axes.text(0.5, 0.5, "none", ha="center", transform=axes.transAxes, color=_GRAY)
    axes.set_xticks([])
    axes.set_yticks([])
