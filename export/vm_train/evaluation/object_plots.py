"""Plots of the scores of objects: curves, scores over distance, errors of distance, and calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vm_workstation.plots import new_figure

from ..scores.calibration import BINS
from ..scores.object_ranking import ObjectRanking
from ..scores.object_scores import ObjectScores
from .axes import (
    FEWEST,
    add_legend,
    bin_middles,
    colors,
    distance_axis,
    label_axes,
    line_styles,
    shared_legend,
    thinned,
    unit_square,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Objects = Mapping[str, ObjectScores]
"""Scores by class; at least one."""


def object_curves(objects: Objects) -> Figure:
    """Precision and the number of false objects per picture, over recall, at each overlap (paper: fig:pr_curve)."""
    figure = new_figure(11.0, 4.6)
    curves, false = figure.subplots(1, 2)
    for name, scores, color in _with_colors(objects):
        for overlap, style in zip(scores.overlaps, line_styles(len(scores.overlaps)), strict=True):
            ranking = scores.ranking(overlap)
            curve = ranking.precision_recall
            look: dict[str, Any] = {"color": color, "linestyle": style, "linewidth": 1.3}
            label = f"{name}, IoU {overlap:g}, AP {curve.average_precision:.3f}"
            if curve.positives:
                curves.plot(curve.recall, curve.precision, label=label, **look)
                rates = [ranking.at(each).false_per_picture for each in thinned(curve.thresholds)]
                false.plot(thinned(curve.recall), rates, label=f"{name}, IoU {overlap:g}", **look)
    unit_square(curves, "recall", "precision")
    label_axes(false, "recall", "false objects per picture")
    false.set_xlim(0.0, 1.0)
    false.set_ylim(bottom=0.0)
    add_legend(false)
    return figure


def objects_over_distance(objects: Objects) -> Figure:
    """Recall, precision, average precision and the number of true objects over distance.

    Average precision is as in the paper's fig:pr_map. Its fig:ball_detection_images_2 shows a ball far away.
    """
    figure = new_figure(11.0, 6.4)
    panels: Sequence[Axes] = list(figure.subplots(2, 2, sharex=True).flat)
    drawn: dict[str, Callable[[ObjectRanking], float]] = {
        "recall": lambda ranking: ranking.at().recall,
        "precision": lambda ranking: ranking.at().precision,
        "average precision": lambda ranking: ranking.precision_recall.average_precision,
    }
    for name, scores, color in _with_colors(objects):
        middles = bin_middles(scores.distance_edges)
        for overlap, style in zip(scores.overlaps, line_styles(len(scores.overlaps)), strict=True):
            rankings = [scores.ranking(overlap, number) for number in range(len(middles))]
            for axes, score in zip(panels, drawn.values(), strict=False):
                values = [score(each) if each.truths >= FEWEST else math.nan for each in rankings]
                look: dict[str, Any] = {"color": color, "linestyle": style, "marker": ".", "markersize": 5}
                axes.plot(middles, values, linewidth=1.2, label=f"{name}, IoU {overlap:g}", **look)
        numbers = [scores.ranking(scores.overlaps[0], number).truths for number in range(len(middles))]
        panels[3].stairs(numbers, scores.distance_edges, color=color, label=name)
    for axes, title in zip(panels, (*drawn, "true objects"), strict=True):
        distance_axis(axes, next(iter(objects.values())).distance_edges, _true_objects(objects))
        axes.set_title(title, fontsize=10)
    for axes in panels[:3]:
        axes.set_ylim(-0.02, 1.02)
    for axes in panels[:2]:
        axes.set_xlabel("")
    shared_legend(figure, panels, 4)
    return figure


def _true_objects(objects: Objects) -> list[int]:
    """The number of true objects of all classes in each distance bin."""
    bins = range(len(next(iter(objects.values())).distance_edges) - 1)
    return [sum(each.ranking(each.overlaps[0], number).truths for each in objects.values()) for number in bins]


def distance_errors(objects: Objects) -> Figure:
    """Distance errors of the objects found at the first overlap: the median, and the range from 10 to 90 %."""
    figure = new_figure(11.0, 4.0)
    signed, relative = figure.subplots(1, 2)
    for name, scores, color in _with_colors(objects):
        middles = bin_middles(scores.distance_edges)
        every = [scores.ranking(scores.overlaps[0], number).errors() for number in range(len(middles))]
        known = [each.count >= FEWEST for each in every]
        columns = [[each.bias, each.low, each.high, each.relative_median, each.relative_p90] for each in every]
        bias, low, high, median, p90 = np.where(known, np.array(columns, dtype=np.float64).T, np.nan)
        signed.plot(middles, bias, color=color, marker=".", linewidth=1.3, label=f"{name}: median")
        signed.fill_between(middles, low, high, color=color, alpha=0.18, linewidth=0, label="10 to 90 %")
        signed.vlines(middles, low, high, color=color, alpha=0.4, linewidth=1.0)  # a single bin has no filled band
        relative.plot(middles, 100.0 * median, color=color, marker=".", linewidth=1.3, label=f"{name}: median")
        relative.plot(
            middles, 100.0 * p90, color=color, marker=".", linestyle="--", linewidth=1.2, label=f"{name}: 90 %"
        )
    for axes, label in ((signed, "found minus true distance [m]"), (relative, "absolute error [% of the distance]")):
        distance_axis(axes, next(iter(objects.values())).distance_edges, _true_objects(objects))
        axes.set_ylabel(label)
        add_legend(axes)
    signed.axhline(0.0, color="black", linewidth=0.7)
    relative.set_ylim(bottom=0.0)
    return figure


def reliability(objects: Objects) -> Figure:
    """Share of right objects over their confidence, at the first overlap, and the number of objects in each bin.

    Vertical lines are 90 % intervals.
    """
    figure = new_figure(11.0, 4.6)
    shares, numbers = figure.subplots(1, 2)
    shares.plot([0.0, 1.0], [0.0, 1.0], color="black", linewidth=0.7)
    for name, scores, color in _with_colors(objects):
        found = scores.ranking(scores.overlaps[0]).reliability
        label = f"{name}, ECE {found.error:.3f}" if found.total else name
        shares.vlines(found.confidences, *found.intervals(), color=color, alpha=0.4, linewidth=1.0)
        shares.plot(found.confidences, found.right, color=color, marker="o", markersize=4, linewidth=1.3, label=label)
        numbers.stairs(found.counts, np.linspace(0.0, 1.0, BINS + 1), color=color, label=name)
    unit_square(shares, "mean confidence", "share right")
    label_axes(numbers, "confidence", "found objects")
    numbers.set_xlim(0.0, 1.0)
    numbers.set_yscale("symlog", linthresh=1.0, linscale=0.3)  # most objects are in few bins
    numbers.yaxis.set_major_formatter("{x:g}")
    numbers.set_ylim(bottom=0.0)
    add_legend(numbers)
    return figure


def _with_colors(objects: Objects) -> Iterator[tuple[str, ObjectScores, str]]:
    """Class, scores and color of its lines."""
    for (name, scores), color in zip(objects.items(), colors(len(objects)), strict=True):
        yield name, scores, color
