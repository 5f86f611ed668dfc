"""Plot of the recall of proposals: over distance, over the radius in the picture, and over the visible share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from vm_workstation.plots import new_figure

from ..scores.object_scores import ObjectScores
from ..scores.proposal_scores import REACHES, ProposalRecall, ProposalScores
from .axes import FEWEST, bin_middles, colors, distance_axis, label_axes, line_styles, shared_legend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LABELS = {"radius": "radius in the picture [px]", "visible": "visible share"}


def proposal_recalls(proposals: Mapping[str, ProposalScores], objects: Mapping[str, ObjectScores]) -> Figure:
    """Recall of proposals at each reach, and for comparison the recall of found objects at the first overlap.

    proposals: by class; at least one. objects: scores of the same classes.
    """
    figure = new_figure(13.0, 4.6)
    panels: Sequence[Axes] = list(figure.subplots(1, 3, sharey=True))
    over_distance, *others = panels
    for (name, scores), color in zip(proposals.items(), colors(len(proposals)), strict=True):
        edges = scores.edges["distance"]
        middles = bin_middles(edges).tolist()
        _draw(over_distance, middles, list(scores.recalls_by("distance").values()), name, color)
        overlap = objects[name].overlaps[0]
        rankings = [objects[name].ranking(overlap, number) for number in range(len(middles))]
        found = [each.at().recall if each.truths >= FEWEST else math.nan for each in rankings]
        over_distance.plot(
            middles, found, color="#555555", marker=".", linestyle=":", label=f"{name}: found, IoU {overlap:g}"
        )
        distance_axis(over_distance, edges, [each.truths for each in scores.recalls_by("distance").values()])
        for axes, measure in zip(others, _LABELS, strict=True):
            bins = scores.recalls_by(measure)
            places = range(len(bins))
            _draw(axes, places, list(bins.values()), name, color)
            axes.set_xticks(places, labels=[_range(each) for each in bins])
            axes.set_xlim(-0.5, len(bins) - 0.5)
            label_axes(axes, _LABELS[measure], "")
    over_distance.set_ylabel("recall")
    over_distance.set_ylim(-0.02, 1.02)
    shared_legend(figure, panels, 3)
    return figure


def _draw(axes: Axes, places: Sequence[float], bins: Sequence[ProposalRecall], name: str, color: str) -> None:
    """A line for each reach, without bins of too few objects."""
    for number, (reach, style) in enumerate(zip(REACHES, line_styles(len(REACHES)), strict=True)):
        shown = [each.recalls[number] if each.truths >= FEWEST else math.nan for each in bins]
        look: dict[str, Any] = {"color": color, "linestyle": style, "linewidth": 1.3, "marker": "o", "markersize": 4}
        look["fillstyle"] = "none" if number else "full"
        axes.plot(places, shown, label=f"{name}: proposed within {reach:g} r", **look)


def _range(name: str) -> str:
    """The name of a bin for people."""
    return f"{name.removesuffix('-inf')}+" if name.endswith("-inf") else name
