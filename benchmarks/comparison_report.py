"""Tables and plots of docs/results.md from benchmarks/comparison.json: `python -m benchmarks.comparison_report`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.comparison import KINDS, RESULTS

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "results.md"
PLOT = DOCS / "results-distance.svg"
NAMES = {
    "all": "no balancing",
    "focal": "focal loss, no balancing",
    "balanced": "balanced selection",
    "hard": "hard-example rounds",
    "hexagonal": "balanced, hexagonal mesh",
}
COLORS = {"all": "#888888", "focal": "#7570b3", "balanced": "#1b9e77", "hard": "#d95f02", "hexagonal": "#e7298a"}
_RARE = 30  # points; a bin with fewer is not drawn


def over_seeds(results: dict[str, Any], *path: str) -> np.ndarray:
    """A score of all seeds; NaN where there is none."""
    values = []
    for scores in results.values():
        found: Any = scores
        for key in path:
            found = found.get(key) if isinstance(found, dict) else None
        values.append(np.nan if found is None else float(found))
    return np.array(values)


def shown(values: np.ndarray, digits: int = 3) -> str:
    """Mean, and lowest to highest of the seeds."""
    if np.isnan(values).all():
        return "-"
    return f"{np.nanmean(values):.{digits}f} ({np.nanmin(values):.{digits}f} to {np.nanmax(values):.{digits}f})"


def table(results: dict[str, Any]) -> str:
    """Scores of all kinds on one set of pictures."""
    heads = ["", "AP of ball points", "F1", "AP, mean of classes", "ball recall", "ball AP", "false a picture"]
    rows = [heads, ["---", *["---:"] * (len(heads) - 1)]]
    for kind in KINDS:
        seeds = results[kind]
        classes = np.array(
            [np.mean([each["average_precision"] for each in scores["classes"].values()]) for scores in seeds.values()]
        )
        rows.append(
            [
                NAMES[kind],
                shown(over_seeds(seeds, "points", "all", "average_precision")),
                shown(over_seeds(seeds, "points", "all", "f1")),
                shown(classes),
                shown(over_seeds(seeds, "iou_0.5", "all", "recall")),
                shown(over_seeds(seeds, "iou_0.5", "all", "average_precision")),
                shown(over_seeds(seeds, "iou_0.5", "all", "false_per_picture"), 2),
            ]
        )
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n"


def bins_of(results: dict[str, Any]) -> list[str]:
    """Distance bins in order."""
    names = [name for name in next(iter(results["balanced"].values()))["points"] if name != "all"]
    return sorted(names, key=lambda name: float(name.split("-")[0]))


def plot(found: dict[str, Any]) -> None:
    """Average precision of the ball's points over distance: all kinds, and the two meshes."""
    import matplotlib
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.6), layout="constrained")
    for axes, (name, results) in zip(figure.subplots(1, 2, sharey=True), found.items(), strict=True):
        bins = bins_of(results)
        middles = np.array([np.mean([float(end) for end in each.split("-")]) for each in bins])
        for kind in KINDS:
            values = np.array([over_seeds(results[kind], "points", each, "average_precision") for each in bins])
            counts = np.array([over_seeds(results[kind], "points", each, "points").min() for each in bins])
            values[counts < _RARE] = np.nan
            style = "--" if kind == "hexagonal" else "-"
            axes.plot(middles, values.mean(axis=1), style, color=COLORS[kind], label=NAMES[kind], linewidth=1.6)
            axes.fill_between(middles, values.min(axis=1), values.max(axis=1), color=COLORS[kind], alpha=0.15, lw=0)
        axes.set_title(f"pictures of {name}", fontsize=10)
        axes.set_xlabel("distance of the point on the plane [m]")
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelleft=True)
    figure.axes[0].set_ylim(bottom=0.0)
    figure.axes[0].set_ylabel("average precision of the ball's points:\nmean and range of three seeds")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=9, frameon=False)
    with matplotlib.rc_context({"svg.hashsalt": "results"}):
        figure.savefig(PLOT, metadata={"Date": None})


def main() -> None:
    found = json.loads(RESULTS.read_text())
    text = PAGE.read_text()
    for name, results in found.items():
        mark = f"<!-- {name} -->\n"
        before, after = text.split(mark)
        text = before + mark + table(results) + after[after.index("<!-- end -->") :]
    PAGE.write_text(text)
    plot(found)


if __name__ == "__main__":
    main()
