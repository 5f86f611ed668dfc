"""The course of a training of YOLO, from the file results.csv that its trainer writes."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path


def read_course(path: Path) -> list[dict[str, float]]:
    """Seconds, loss and average precision on validation pictures of each epoch.

    The trainer counts the time from its start, so it begins again after an interruption.
    """
    with path.open() as file:
        rows = [{name.strip(): float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    times = [0.0, *(row["time"] for row in rows)]
    return [
        {
            "epoch": int(row["epoch"]),
            "seconds": round(end - begin if end > begin else end),
            "loss": round(sum(row[f"train/{part}_loss"] for part in ("box", "cls", "dfl")), 4),
            "ap50": row["metrics/mAP50(B)"],
            "ap50_95": row["metrics/mAP50-95(B)"],
        }
        for row, (begin, end) in zip(rows, pairwise(times), strict=True)
    ]
