"""Tables and plot of experiments/mesh-network.md from choices.json: `python -m benchmarks.choices_report`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from benchmarks.choices import HEIGHTS, LENSES, RESULTS
from benchmarks.report import EXPERIMENTS, fill, spread, table
from vm_workstation.plots import new_figure, save_figure

GROUPS = {
    "layers and mesh": (
        "3 layers", "base", "9 layers", "as ball",
        "hexagonal, 3 layers", "hexagonal, 5 layers", "hexagonal, 9 layers", "hexagonal, as ball",
    ),
    "activation": ("base", "elu", "relu"),
    "width": ("width 2", "base", "width 8", "width 16"),
    "rings across a ball": ("k = 3", "base", "k = 5", "k = 6"),
    "point features": ("base", "absolute colors", "bilinear points", "mesh to 10 m"),
    "point selection": (
        "base", "balance 0.15", "balance 0.7", "all points", "focal loss", "balanced selection", "hard-example rounds",
    ),
    "classes": ("base", "six classes"),
    "augmentation": (
        "base", "no augmentation", "pose not augmented", "colors not augmented", "sharpness not augmented",
    ),
}  # fmt: skip
BASE = {
    "layers and mesh": "5 layers",
    "activation": "selu",
    "width": "width 4",
    "rings across a ball": "k = 4",
    "point features": "relative colors, footprints, to 14 m",
    "point selection": "weighted, balance 0.3",
    "classes": "ball and other",
    "augmentation": "all augmentation",
}
"""Name of the base network in each group."""

COLORS = {"3 layers": "#7570b3", "5 layers": "#1b9e77", "9 layers": "#d95f02", "as ball": "#444444"}


def values(scores: dict[str, Any], *path: str, test: str = "all") -> list[float | None]:
    """A score of all seeds; None where it is missing."""
    found = []
    for each in scores.values():
        value: Any = each.get(test, {})
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        found.append(value)
    return found


def group(results: dict[str, Any], name: str) -> str:
    """Scores of the variants of one group."""
    rows = []
    for variant in GROUPS[name]:
        scores = results[variant]
        rows.append(
            [
                BASE[name] if variant == "base" else variant,
                str(len(scores)),
                spread(values(scores, "points", "all", "average_precision")),
                spread(values(scores, "iou_0.5", "average_precision")),
                spread(values(scores, "iou_0.75", "average_precision")),
                spread(values(scores, "iou_0.5", "recall")),
                spread(values(scores, "iou_0.5", "false_per_picture"), 2),
            ]
        )
    return table(["", "seeds", "AP of points", "AP50", "AP75", "recall", "false per picture"], rows)


def transfer(results: dict[str, Any], kinds: tuple[str, ...]) -> str:
    """AP of points of networks that learned on one half of the pictures, on each half."""
    rows = []
    for name in (*(f"learned {kind}" for kind in kinds), "base"):
        cells = [spread(values(results[name], "points", "all", "average_precision", test=kind)) for kind in kinds]
        objects = [spread(values(results[name], "iou_0.5", "average_precision", test=kind)) for kind in kinds]
        label = "all, 2000 pictures" if name == "base" else f"{name.removeprefix('learned ')}, 800 pictures"
        rows.append([label, *(f"{points}; {balls}" for points, balls in zip(cells, objects, strict=True))])
    return table(["trained on", *(f"tested on {kind}" for kind in kinds)], rows)


def plot(results: dict[str, Any]) -> None:
    """Precision over recall of ball points, and their average precision over distance.

    Both are for both meshes and three depths, as in the paper's fig:pr_curve and fig:pr_map (section "Precision"), and
    for the mesh network of `ball`.
    """
    figure = new_figure(11.0, 4.4)
    curves, distances = figure.subplots(1, 2)
    for network, color in COLORS.items():
        visual = "base" if network == BASE["layers and mesh"] else network
        for style, name, grid in (("-", visual, "Visual Mesh"), ("--", f"hexagonal, {network}", "hexagonal")):
            label = f"{grid}, {network}"
            recall, precision = np.array(next(iter(results[name].values()))["all"]["curve"]).T
            curves.plot(recall, precision, style, color=color, label=label)
            bins = sorted(
                (each for each in next(iter(results[name].values()))["all"]["points"] if each != "all"),
                key=lambda each: float(each.split("-")[0]),
            )
            precisions = [values(results[name], "points", each, "average_precision") for each in bins]
            middles = [np.mean([float(end) for end in each.split("-")]) for each in bins]
            distances.plot(middles, np.array(precisions, float).mean(axis=1), style, color=color, label=label)
    curves.set_xlabel("recall of ball points")
    curves.set_ylabel("precision")
    distances.set_xlabel("distance of the point on the plane [m]")
    distances.set_ylabel("average precision of ball points")
    for axes in (curves, distances):
        axes.set_ylim(0.0, 1.02)
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    handles, labels = curves.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    save_figure(figure, EXPERIMENTS / "choices.svg")


def main() -> None:
    results = json.loads(RESULTS.read_text())
    made = {name: group(results, name) for name in GROUPS}
    made |= {"lenses": transfer(results, LENSES), "heights": transfer(results, HEIGHTS)}
    fill(EXPERIMENTS / "mesh-network.md", made)
    plot(results)


if __name__ == "__main__":
    main()
