"""From peer_times.json to the tables about other detectors in docs/results.md: `python -m benchmarks.peers.report`."""

from __future__ import annotations

import json
from typing import Any

from ..report import DOCS, fill, machine, ms, table
from .times import RESULTS, TWO_STAGE

PAGE = DOCS / "results.md"

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


def _times(factor: float) -> str:
    return f"{factor:.1f}" if factor < 10 else f"{factor:.0f}"


def proposals(found: dict[str, Any]) -> str:
    part = found["proposals"]
    rows = [
        [name, f"{row['operations'] / 1e6:.2f}", f"{row['one']['p50']:.3f}", f"{row['each of a batch']['p50']:.3f}"]
        for name, row in part["networks"].items()
    ]
    for name, row in part["stage"].items():
        count = row["patches"]["glance"]
        rows.append([f"whole stage of {name}", "-", "-", f"{row['p50'] / count:.3f}"])
    return table(["network", "MFLOP", "alone", f"in a call of {part['batch']}"], rows)


TABLES = {"machine of the times": machine, "paper's table": times, "per proposal": proposals}
"""The tables from peer_times.json, by the marks of the page."""


def main() -> None:
    found = json.loads(RESULTS.read_text())
    fill(PAGE, {name: made(found) for name, made in TABLES.items()})


if __name__ == "__main__":
    main()
