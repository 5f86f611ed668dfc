"""The table and plot of experiments/close-look.md: `python -m benchmarks.look_choices_report`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from benchmarks.look_choices import RESULTS
from benchmarks.report import EXPERIMENTS, fill, spread, table
from vm_workstation.plots import new_figure, save_figure

NEAR, FAR = "0.5 to 6 m", "6 to 10 m"


def choices(found: dict[str, Any]) -> str:
    """A row for each variant: its scores over the seeds, and its time."""
    rows = []
    for name, seeds in found["scores"].items():
        each = list(seeds.values())
        rows.append(
            [
                name,
                *(spread([scores["ap50"][bins] for scores in each]) for bins in (NEAR, FAR)),
                spread([scores["ap75"][NEAR] for scores in each]),
                spread([scores["used"][NEAR]["recall"] for scores in each], 1, 100.0),
                spread([scores["all"]["false_per_picture"] for scores in each]),
                spread([scores["calibration_error"] for scores in each]),
                f"{found['milliseconds'][name]:.2f}",
            ]
        )
    heads = ["look", "AP50, 0.5 to 6 m", "6 to 10 m", "AP75, 0.5 to 6 m", "found [%], 0.5 to 6 m", "false per picture"]
    return table([*heads, "calibration error", "whole call [ms]"], rows)


def plot(found: dict[str, Any]) -> None:
    """AP50 over the time of a whole call, a dot for each variant."""
    figure = new_figure(9.0, 5.0)
    axes = figure.subplots()
    near = {name: [scores["ap50"][NEAR] for scores in seeds.values()] for name, seeds in found["scores"].items()}
    for place, (name, values) in enumerate(sorted(near.items(), key=lambda each: np.mean(each[1]))):
        time = found["milliseconds"][name]
        color = "#d95f02" if name == "base" else "#7570b3"
        axes.plot([time, time], [min(values), max(values)], color=color, alpha=0.4)
        axes.plot(time, np.mean(values), "o", color=color)
        side, offset = ("left", 5) if place % 2 else ("right", -5)  # names of equal height do not overlap
        at = (time, float(np.mean(values)))
        axes.annotate(name, at, xytext=(offset, -2), textcoords="offset points", fontsize=7, ha=side)
    axes.margins(x=0.15)
    axes.set_xlabel("whole call, median [ms]")
    axes.set_ylabel("AP50, 0.5 to 6 m (line: lowest and highest seed)")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, EXPERIMENTS / "look-choices.svg")


def main() -> None:
    found = json.loads(RESULTS.read_text())
    fill(EXPERIMENTS / "close-look.md", {"look choices": choices(found)})
    plot(found)


if __name__ == "__main__":
    main()
