"""Plots of an evaluation: curves of points and objects, all scores over distance, and the confusion of classes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_workstation.plots import new_figure

from ..scores.curves import Counts
from ..scores.object_ranking import ObjectRanking
from ..scores.object_scores import ObjectScores
from ..scores.point_scores import PointScores
from .evaluation import Evaluation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS = ("#d62728", "#1f77b4", "#2ca02c", "#7f7f7f", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#e377c2", "#bcbd22")
_LINES = ("-", "--", ":")
_FEWEST = 10
"""Objects that a bin of distance needs, for its scores to be drawn: those of fewer are chance."""

_POINT_SCORES = ("precision", "recall", "f1", "average_precision", "mcc", "informedness", "markedness", "roc_auc")


def plots(evaluation: Evaluation, threshold: float) -> dict[str, Figure]:
    """All plots by name. threshold: probability from which a point counts. Raises InputError without matplotlib."""
    points, objects = evaluation.points, evaluation.objects
    found = {
        "points_curves": point_curves(points),
        "points_over_distance": points_over_distance(points, threshold),
        "confusion": confusion(points),
    }
    if objects:
        found["objects_curves"] = object_curves(objects)
        found["objects_over_distance"] = objects_over_distance(objects)
        found["distance_error"] = distance_errors(objects)
    return found


def point_curves(scores: PointScores) -> Figure:
    """Precision over recall, and the rates of true over false positives, a line for each class."""
    figure = new_figure(11.0, 4.6)
    curves, rocs = figure.subplots(1, 2)
    for name, color in zip(scores.classes, _repeated(_COLORS), strict=False):
        ranking = scores.ranking(name)
        curve, roc = ranking.precision_recall, ranking.roc
        if curve.positives:
            label = f"{name}, AP {curve.average_precision:.3f}"
            curves.plot(curve.recall, curve.precision, color=color, linewidth=1.3, label=label)
        if not math.isnan(roc.area):
            label = f"{name}, area {roc.area:.4f}"
            rocs.plot(roc.false_positive_rate, roc.true_positive_rate, color=color, linewidth=1.3, label=label)
    rocs.set_xscale("symlog", linthresh=1e-4, linscale=0.5)
    rocs.set_xticks([0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0], labels=["0", "0.0001", "0.001", "0.01", "0.1", "1"])
    rocs.minorticks_off()
    _shares(curves, "recall", "precision")
    _shares(rocs, "rate of false positives", "rate of true positives")
    return figure


def points_over_distance(scores: PointScores, threshold: float) -> Figure:
    """All scores of the points of each class, over their distance."""
    figure = new_figure(13.0, 6.0)
    middles = _middles(scores.distance_edges)
    panels = list(figure.subplots(2, len(_POINT_SCORES) // 2, sharex=True).flat)
    for name, color in zip(scores.classes, _repeated(_COLORS), strict=False):
        rankings = [scores.ranking(name, number).as_dict(threshold) for number in range(len(middles))]
        for axes, what in zip(panels, _POINT_SCORES, strict=True):
            values = [math.nan if each[what] is None else each[what] for each in rankings]
            axes.plot(middles, values, color=color, linewidth=1.2, marker=".", markersize=4, label=name)
    for axes, what in zip(panels, _POINT_SCORES, strict=True):
        _over_distance(axes, scores.distance_edges)
        axes.set_title(_titled(what), fontsize=10)
        axes.set_ylim(min(-0.02, axes.get_ylim()[0]), 1.02)  # chance and worse is 0 and below for some
    for axes in panels[: len(panels) // 2]:
        axes.set_xlabel("")
    keys, names = panels[0].get_legend_handles_labels()
    figure.legend(keys, names, loc="outside lower center", ncols=min(len(names), 6), fontsize=9, frameon=False)
    return figure


def confusion(scores: PointScores) -> Figure:
    """Which share of the points of a class (rows) was taken for which (columns)."""
    counts: Counts = scores.confusion()
    rows = counts.sum(axis=1, keepdims=True)
    share = np.divide(counts, rows, out=np.full(counts.shape, np.nan), where=rows > 0)
    side = 2.4 + 0.75 * len(scores.classes)
    figure = new_figure(side + 0.6, side)
    axes = figure.subplots()
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    ticks = range(len(scores.classes))
    axes.set_xticks(ticks, labels=list(scores.classes), rotation=30, ha="right", rotation_mode="anchor")
    axes.set_yticks(ticks, labels=list(scores.classes))
    axes.set_xlabel("taken for")
    axes.set_ylabel("true class of the point")
    for row, column in np.ndindex(share.shape):
        value = float(share[row, column])
        text = "-" if math.isnan(value) else f"{100.0 * value:.1f} %"
        axes.text(column, row, text, ha="center", va="center", fontsize=9, color="white" if value > 0.6 else "black")
    return figure


def object_curves(objects: dict[str, ObjectScores]) -> Figure:
    """Precision over recall at each overlap, and how many are false in a picture over recall."""
    figure = new_figure(11.0, 4.6)
    curves, false = figure.subplots(1, 2)
    for name, scores, color in _colored(objects):
        for overlap, style in zip(scores.overlaps, _repeated(_LINES), strict=False):
            ranking = scores.ranking(overlap)
            curve = ranking.precision_recall
            look: dict[str, Any] = {"color": color, "linestyle": style, "linewidth": 1.3}
            label = f"{name}, IoU {overlap:g}, AP {curve.average_precision:.3f}"
            if curve.positives:
                curves.plot(curve.recall, curve.precision, label=label, **look)
                rates = [ranking.at(each).false_per_picture for each in _thinned(curve.thresholds)]
                false.plot(_thinned(curve.recall), rates, label=f"{name}, IoU {overlap:g}", **look)
    _shares(curves, "recall", "precision")
    _framed(false, "recall", "false objects in a picture")
    false.set_xlim(0.0, 1.0)
    false.set_ylim(bottom=0.0)
    _legend(false)
    return figure


def objects_over_distance(objects: dict[str, ObjectScores]) -> Figure:
    """Recall, precision and average precision over distance, and how many objects there are."""
    figure = new_figure(11.0, 6.4)
    panels: Sequence[Axes] = list(figure.subplots(2, 2, sharex=True).flat)
    drawn: dict[str, Callable[[ObjectRanking], float]] = {
        "recall": lambda ranking: ranking.at().recall,
        "precision": lambda ranking: ranking.at().precision,
        "average precision": lambda ranking: ranking.precision_recall.average_precision,
    }
    for name, scores, color in _colored(objects):
        middles = _middles(scores.distance_edges)
        for overlap, style in zip(scores.overlaps, _repeated(_LINES), strict=False):
            rankings = [scores.ranking(overlap, number) for number in range(len(middles))]
            for axes, score in zip(panels, drawn.values(), strict=False):
                values = [score(each) if each.truths >= _FEWEST else math.nan for each in rankings]
                look: dict[str, Any] = {"color": color, "linestyle": style, "marker": ".", "markersize": 5}
                axes.plot(middles, values, linewidth=1.2, label=f"{name}, IoU {overlap:g}", **look)
        numbers = [scores.ranking(scores.overlaps[0], number).truths for number in range(len(middles))]
        panels[3].stairs(numbers, scores.distance_edges, color=color, label=name)
    for axes, title in zip(panels, (*drawn, "true objects"), strict=True):
        _over_distance(axes, next(iter(objects.values())).distance_edges)
        axes.set_title(title, fontsize=10)
    for axes in panels[:3]:
        axes.set_ylim(-0.02, 1.02)
    for axes in panels[:2]:
        axes.set_xlabel("")
    keys, names = panels[0].get_legend_handles_labels()
    figure.legend(keys, names, loc="outside lower center", ncols=min(len(names), 4), fontsize=9, frameon=False)
    return figure


def distance_errors(objects: dict[str, ObjectScores]) -> Figure:
    """Errors of distance of the objects that are right at the first overlap: median, and 10 to 90 %."""
    figure = new_figure(11.0, 4.0)
    signed, relative = figure.subplots(1, 2)
    for name, scores, color in _colored(objects):
        middles = _middles(scores.distance_edges)
        every = [scores.ranking(scores.overlaps[0], number).errors() for number in range(len(middles))]
        known = [each.count >= _FEWEST for each in every]
        columns = [[each.bias, each.low, each.high, each.relative_median, each.relative_p90] for each in every]
        bias, low, high, median, p90 = np.where(known, np.array(columns, dtype=np.float64).T, np.nan)
        signed.plot(middles, bias, color=color, marker=".", linewidth=1.3, label=f"{name}: median")
        signed.fill_between(middles, low, high, color=color, alpha=0.18, linewidth=0, label="10 to 90 %")
        signed.vlines(middles, low, high, color=color, alpha=0.4, linewidth=1.0)  # a bin alone has no band
        relative.plot(middles, 100.0 * median, color=color, marker=".", linewidth=1.3, label=f"{name}: median")
        relative.plot(middles, 100.0 * p90, color=color, linestyle="--", linewidth=1.2, label=f"{name}: 90 %")
    for axes, label in ((signed, "found minus true distance [m]"), (relative, "absolute error [% of the distance]")):
        _over_distance(axes, next(iter(objects.values())).distance_edges)
        axes.set_ylabel(label)
        _legend(axes)
    signed.axhline(0.0, color="black", linewidth=0.7)
    relative.set_ylim(bottom=0.0)
    return figure


def _colored(objects: dict[str, ObjectScores]) -> list[tuple[str, ObjectScores, str]]:
    return [(name, scores, color) for (name, scores), color in zip(objects.items(), _repeated(_COLORS), strict=False)]


def _repeated(values: Sequence[str]) -> list[str]:
    return [*values] * 8


def _titled(name: str) -> str:
    return {"f1": "F1", "mcc": "MCC", "roc_auc": "area under ROC"}.get(name, name.replace("_", " "))


def _middles(edges: Floats) -> Floats:
    return np.asarray((edges[:-1] + edges[1:]) / 2.0)


def _thinned(values: Floats) -> Floats:
    """About 300 of the values, first and last among them."""
    return values[np.unique(np.linspace(0, len(values) - 1, 300).astype(int))] if len(values) else values


def _shares(axes: Axes, x: str, y: str) -> None:
    """Axes of two shares from 0 to 1."""
    _framed(axes, x, y)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.02)
    _legend(axes)


def _over_distance(axes: Axes, edges: Floats) -> None:
    _framed(axes, "distance [m]", "")
    axes.set_xlim(float(edges[0]), float(edges[-1]))


def _framed(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False)
