"""From the results of the peers to the tables and plots of experiments/other-detectors.md.

Run it with `python -m benchmarks.peers.report`.

It reads peer_times.json, peer_training.json and peer_scores.json of this folder's parent.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from vm_workstation.plots import new_figure, save_figure

from ..report import DOCS, EXPERIMENTS, fill, machine, ms, number, table
from . import score, train
from .boxes import LENSES
from .detector import TRAINED
from .times import RESULTS, TODAY, TWO_STAGE

PAGE = EXPERIMENTS / "other-detectors.md"

PAPER = {
    "Visual Mesh 5": 1.64,
    "Visual Mesh 9": 2.44,
    "YOLO v1, 448": 1468.24,
    "YOLO v2, 416": 1221.49,
    "YOLO v3, 416": 2651.33,
    "SSD MobileNet v1, 300": 37.76,
    TWO_STAGE: 1521.32,
}
"""Times of the paper's tab:visualmesh_performance on an Intel Core i7-7567U [ms]."""

_BASE = "Visual Mesh 5"


def times(found: dict[str, Any]) -> str:
    calls = found["calls"]
    base = calls[_BASE]["p50"]
    rows = []
    for name, row in calls.items():
        paper = PAPER.get(name)
        theirs = ["-"] * 3
        if paper is not None:
            theirs = [f"{paper:.2f}", _times(paper / PAPER[_BASE]), _times(paper / row["p50"])]
        ours = [*(ms(row[each]) for each in ("p50", "p99", "first")), _times(row["p50"] / base)]
        rows.append([name, f"{row['operations'] / 1e9:.3g}", *theirs[:2], *ours, theirs[2]])
    heads = ["detector", "GFLOP", "paper", "relative", "here", "p99", "first call", "relative", "paper / here"]
    return table(heads, rows)


def on_frames(found: dict[str, Any]) -> str:
    """Times on all frames, also as shares of those of the last detector of TODAY."""
    rows = []
    for instructions, sets in found["all frames"].items():
        for name, row in sets[next(iter(sets))].items():
            cells = []
            for calls in sets.values():
                share = calls[name]["p50"] / calls[TODAY[-1]]["p50"]
                cells += [ms(calls[name]["p50"]), ms(calls[name]["p99"]), f"{share:.2f}"]
                cells.append(ms(calls[name]["noise"]) if "noise" in row else "-")
            rows.append([instructions, name, *cells])
    heads = [f"{each}: {head}" for each in sets for head in ("median", "p99", f"of {TODAY[-1]}", "noise")]
    return table(["instructions of ONNX Runtime", "detector", *heads], rows)


def _times(factor: float) -> str:
    return f"{factor:.1f}" if factor < 10 else f"{factor:.0f}"


def proposals(found: dict[str, Any]) -> str:
    part = found["proposals"]
    rows = [
        [name, f"{row['operations'] / 1e6:.2f}", f"{row['one']['p50']:.3f}", f"{row['each of a batch']['p50']:.3f}"]
        for name, row in part["networks"].items()
    ]
    for name, row in part["stage"].items():
        rows.append([f"whole stage of {name}", "-", "-", f"{row['p50'] / row['patches']:.3f}"])
    return table(["network", "MFLOP", "alone", f"in a call of {part['batch']}"], rows)


def trainings(found: dict[str, Any]) -> str:
    rows = []
    for lens in train.EPOCHS:
        for peer in TRAINED:
            part = found[lens][peer.stem]
            epochs, improved = part["epochs"], "yes" if part["still_improved"] else "no"
            last = [number(epochs[-1].get(each), 3) for each in ("ap50", "ap50_95")]
            seen, loss = f"{found[lens]['training pictures'] * len(epochs):,}", f"{epochs[-1]['loss']:.2f}"
            done = str(len(epochs)) if len(epochs) == part["planned"] else f"{len(epochs)} of {part['planned']}"
            rows.append([peer.name, lens, done, seen, loss, *last, improved])
    heads = ["detector", "learned from", "epochs", "pictures seen", "last loss", "validation AP50", "AP50 to AP95"]
    return table([*heads, "still improved"], rows)


def _kinds() -> list[tuple[str, str, str]]:
    """Name of the row, detector, and ending of the names of its test sets."""
    checked = [(f"{peer.name}, sizes checked", peer.name, ", sizes checked") for peer in TRAINED]
    plain = [(peer.name, peer.name, "") for peer in TRAINED]
    rows = [(name, name, "") for name in score.OURS]
    return rows + [each for pair in zip(plain, checked, strict=True) for each in pair]


def accuracy(found: dict[str, Any], which: str) -> str:
    rows = []
    for title, name, ending in _kinds():
        part = found[name][which + ending]
        values = [number(part[bins]["ap50"], 3) for bins in ("0.5 to 6 m", "6 to 10 m", "4 to 10 m", "all")]
        values += [number(part[bins]["ap75"], 3) for bins in ("0.5 to 6 m", "6 to 10 m")]
        values += [number(part["all"]["found"], 1, 100.0), number(part["all"]["false"], 3)]
        rows.append([title, *values])
    heads = ["detector", "AP50, 0.5 to 6 m", "6 to 10 m", "4 to 10 m", "all", "AP75, 0.5 to 6 m", "6 to 10 m"]
    return table([*heads, "found [%]", "false per picture"], rows)


def frames(found: dict[str, Any]) -> str:
    rows = []
    for name in (*score.OURS, *(peer.name for peer in TRAINED)):
        row = [name]
        for folder, _ in score.SHARED:
            part = found[name]["frames"][folder]
            row += [
                f"{part['found']} of {part['balls']}",
                f"{part['found_near']} of {part['balls_near']}",
                str(part["false"]),
            ]
        rows.append(row)
    heads = ["real frames: found", "nearer than 6 m", "false", "reference frames: found", "nearer than 6 m", "false"]
    return table(["detector", *heads], rows)


def lenses(found: dict[str, Any]) -> str:
    """AP50 by the kind of lens and by the size, of the scored detectors, also of those that learned from one kind."""
    rows = []
    for lens in train.EPOCHS:
        for name in (*(score.OURS if lens == train.ALL_LENSES else (score.SAME,)), *(peer.name for peer in TRAINED)):
            part = found.get(score.title(name, lens))
            if part is None:
                continue
            values = [part["lenses"][kind]["ap50"] for kind in LENSES]
            drop = None if None in values else values[0] - values[1]
            values += [drop, *(part["sizes"][f"{factor:g}"]["ap50"] for factor in reversed(score.FACTORS))]
            rows.append([name, lens, *(number(each, 3) for each in values)])
    sizes = [f"{1280 * factor:.0f} x {1024 * factor:.0f} px" for factor in reversed(score.FACTORS)]
    return table(["detector", "learned from", *LENSES, "difference", *sizes], rows)


def _style(name: str) -> dict[str, Any]:
    if name in score.OURS:
        lines = dict(zip(score.OURS, ("-", ":", "--"), strict=True))
        return {"color": "#2a7f62", "linestyle": lines[name], "label": name}
    color = {"ssdlite": "#c0504d", "yolo320": "#8064a2", "yolo640": "#4f81bd"}
    return {"color": color[next(each.stem for each in TRAINED if each.name == name)], "label": name}


def plot_accuracy(found: dict[str, Any], path: Path) -> None:
    """Precision over recall, and average precision over distance; IoU 0.75, and 0.5.

    The paper shows both in fig:plots (section "Precision").
    """
    figure = new_figure(11.0, 3.6)
    panels = curves, ap75, ap50 = figure.subplots(1, 3)
    for name in (*score.OURS, *(peer.name for peer in TRAINED)):
        if found[name]["curve"]:
            curves.plot(*zip(*found[name]["curve"], strict=True), **_style(name))
        for axes, which in ((ap75, "ap75"), (ap50, "ap50")):
            bins = [found[name]["field"][each][which] for each in score.METERS]
            axes.plot([meter + 0.5 for meter in range(len(bins))], bins, marker="o", markersize=3, **_style(name))
    curves.set_xlabel("recall at IoU 0.75")
    curves.set_ylabel("precision")
    for axes, which in ((ap75, "AP75"), (ap50, "AP50")):
        axes.set_xlabel("distance [m]")
        axes.set_ylabel(which)
    for axes in panels:
        axes.set_ylim(0.0, 1.02)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(*ap50.get_legend_handles_labels(), frameon=False, fontsize=8, loc="outside lower center", ncols=5)
    save_figure(figure, path)


def plot_times(found: dict[str, Any], calls: dict[str, Any], path: Path) -> None:
    """AP50 of each detector, at all distances, over the time of a whole call."""
    figure = new_figure(7.5, 3.6)
    axes = figure.subplots()
    for name in (*score.OURS, *(peer.name for peer in TRAINED)):
        x, ours = calls[name.partition(", same")[0]]["p50"], name in score.OURS
        y = found[name]["field"]["all"]["ap50"]
        axes.plot(x, y, "o", color="#2a7f62" if ours else "#9aa5b1")
        axes.annotate(name, (x, y), textcoords="offset points", fontsize=8, va="center", xytext=(6, 0))
        checked = found[name].get("field, sizes checked")
        if checked:
            axes.plot(x, checked["all"]["ap50"], "o", color="#9aa5b1", fillstyle="none")
    axes.set_xscale("log")
    axes.set_xlim(1, 400)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel("whole call on one core [ms], log scale")
    axes.set_ylabel("AP50 on fields")
    axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, path)


Tables = dict[str, Callable[[dict[str, Any]], str]]
"""Functions that make tables from results, by the marks of the page."""

TABLES: Tables = {
    "machine of the times": machine,
    "paper's table": times,
    "all frames": on_frames,
    "per proposal": proposals,
}
"""The tables from peer_times.json."""

TRAININGS: Tables = {"peers' trainings": trainings}
"""The tables from peer_training.json."""

SCORES: Tables = {
    "peers on fields": partial(accuracy, which="field"),
    "peers in clutter": partial(accuracy, which="clutter"),
    "peers on frames": frames,
    "peers by lens": lenses,
}
"""The tables from peer_scores.json."""


def tables() -> dict[str, str]:
    """All tables of the page by their marks."""
    parts = ((RESULTS, TABLES), (train.LOG, TRAININGS), (score.RESULTS, SCORES))
    return {name: make(json.loads(path.read_text())) for path, made in parts for name, make in made.items()}


def main() -> None:
    fill(PAGE, tables())
    scores = json.loads(score.RESULTS.read_text())
    plot_accuracy(scores, DOCS / "peers-accuracy.svg")
    plot_times(scores, json.loads(RESULTS.read_text())["calls"], EXPERIMENTS / "peers-time.svg")


if __name__ == "__main__":
    main()
