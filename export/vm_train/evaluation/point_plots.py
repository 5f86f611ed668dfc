"""Plots of the scores of points: curves, scores over distance, and the confusion of classes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from vm_workstation.plots import new_figure

from ..scores.curves import Counts
from ..scores.point_scores import PointScores
from .axes import bin_middles, colors, distance_axis, shared_legend, unit_square

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SCORES = ("precision", "recall", "f1", "average_precision", "mcc", "informedness", "markedness", "roc_auc")


def point_curves(scores: PointScores) -> Figure:
    """Precision over recall, and the rate of true over that of false positives, with a line for each class.

    The paper's fig:pr_curve.
    """
    figure = new_figure(11.0, 4.6)
    curves, rocs = figure.subplots(1, 2)
    for name, color in zip(scores.classes, colors(len(scores.classes)), strict=True):
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
    unit_square(curves, "recall", "precision")
    unit_square(rocs, "false positive rate", "true positive rate")
    return figure


def points_over_distance(scores: PointScores, threshold: float) -> Figure:
    """All scores of each class's points over their distance, average precision as in the paper's fig:pr_map.

    threshold: probability from which a point counts.
    """
    figure = new_figure(13.0, 6.0)
    middles = bin_middles(scores.distance_edges)
    panels = list(figure.subplots(2, len(_SCORES) // 2, sharex=True).flat)
    for name, color in zip(scores.classes, colors(len(scores.classes)), strict=True):
        rankings = [scores.ranking(name, number).as_dict(threshold) for number in range(len(middles))]
        for axes, score in zip(panels, _SCORES, strict=True):
            values = [math.nan if each[score] is None else each[score] for each in rankings]
            axes.plot(middles, values, color=color, linewidth=1.2, marker=".", markersize=4, label=name)
    counts = [int(scores.confusion(number).sum()) for number in range(len(middles))]
    for axes, score in zip(panels, _SCORES, strict=True):
        distance_axis(axes, scores.distance_edges, counts)
        axes.set_title(_title(score), fontsize=10)
        axes.set_ylim(min(-0.02, axes.get_ylim()[0]), 1.02)  # some scores are 0 by chance, and below 0 if worse
    for axes in panels[: len(panels) // 2]:
        axes.set_xlabel("")
    shared_legend(figure, panels, 6)
    return figure


def confusion(scores: PointScores) -> Figure:
    """Shares of the points of each true class (row) for which each class (column) is the most probable."""
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
    axes.set_xlabel("most probable class")
    axes.set_ylabel("true class")
    for row, column in np.ndindex(share.shape):
        value = float(share[row, column])
        text = "-" if math.isnan(value) else f"{100.0 * value:.1f} %"
        axes.text(column, row, text, ha="center", va="center", fontsize=9, color="white" if value > 0.6 else "black")
    return figure


def _title(score: str) -> str:
    return {"f1": "F1", "mcc": "MCC", "roc_auc": "area under ROC"}.get(score, score.replace("_", " "))
