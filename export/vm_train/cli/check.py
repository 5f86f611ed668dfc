"""vm-train check: facts about the pictures of a data set, and the pictures that can't be used."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.borders.text import to_json
from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.files import check_writable, write_file
from vm_workstation.option_types import at_least
from vm_workstation.text_tables import aligned, summary

from ..boxes.findings import Finding, finding_lines
from ..data.classes import Classes
from ..data.inspection import Inspection, inspect_pictures
from ..data.picture_files import paths_of
from ..data.pictures import find_pictures
from .check_boxes import add_check_boxes

EXIT_FAULTS = 1

_KINDS = {
    "missing": "pictures lack a file",
    "damaged": "pictures have a file that can't be read",
    "size": "pictures have a mask of another size than the image",
    "lens": "pictures have an invalid lens file",
    "color": "pictures have a mask with unknown colors or another pixel format",
}

_EDGES = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Edges of the distance bins in the table [m]."""


def check_parser() -> argparse.ArgumentParser:
    """The options of vm-train check DATA."""
    made = Parser(
        prog="vm-train check",
        description="Read all pictures of a folder. Print tables of their contents, and list "
        "the unusable pictures. With --boxes, do this for images with boxes. Exit status: 0 if all can be used, 1 "
        "otherwise.",
    )
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")
    made.add_argument(
        "--config", type=Path, metavar="FILE", help="train.toml with the classes; default: those of vm-synth"
    )
    made.add_argument("--workers", type=at_least(1), metavar="N", help="reading processes; default: all cores")
    made.add_argument("--json", type=Path, metavar="FILE", help="write all results and all faults to this file")
    made.add_argument("--verbose", action="store_true", help="print all faults and remarks, not one line for each kind")
    made.add_argument("--strict", action="store_true", help="also exit with 1 if a class appears in no picture")
    add_check_boxes(made)
    return made


def run_check(options: argparse.Namespace, classes: Classes, objects: Sequence[str] = ()) -> int:
    """Check as the options say and return the exit status. objects: classes whose distances to print.

    Raises InputError if there are no pictures, or if the results can't be written.
    """
    pictures = find_pictures(options.data)
    if options.json is not None:
        check_writable(options.json, (options.config, *paths_of(pictures)))
    workers = len(os.sched_getaffinity(0)) if options.workers is None else options.workers
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        found = inspect_pictures(pictures, classes, workers, bar.advance, objects)
    finally:
        bar.clear()
    print("\n".join(tables(found)))
    if options.json is not None:
        write_file(options.json, to_json(as_json(found), indent=1) + "\n")
    for line in complaints(found, options.verbose):
        print(f"vm-train: {line}", file=sys.stderr)
    return EXIT_FAULTS if found.faults or (options.strict and found.absent) else EXIT_OK


def tables(found: Inspection) -> Iterator[str]:
    """The lines of the report."""
    yield f"{found.count} pictures, {len(found.faults)} of them can't be used"
    if not found.facts:
        return
    count = len(found.facts)
    sizes = {f"{width} x {height} px": number for (width, height), number in found.sizes.most_common()}
    for name, numbers in (("size", sizes), ("lens", dict(found.lenses.most_common()))):
        yield f"{name:<6}" + ", ".join(f"{each} {n} ({100.0 * n / count:.1f} %)" for each, n in numbers.items())
    yield ""
    quantities = _quantities(found)
    rows = [[name, *(f"{each:.2f}" for each in numbers.values())] for name, numbers in quantities.items()]
    yield from aligned([["", *next(iter(quantities.values()))], *rows])
    yield ""
    total = sum(width * height * n for (width, height), n in found.sizes.items())
    shown = found.shown
    rows = [
        [name, str(shown[name]), f"{100.0 * shown[name] / count:.1f}", f"{100.0 * pixels / total:.3f}"]
        for name, pixels in found.pixels.items()
    ]
    unlabeled = 100.0 * sum(each.unlabeled for each in found.facts) / total
    yield from aligned([["class", "pictures", "[%]", "pixels [%]"], *rows, ["unlabeled", "", "", f"{unlabeled:.3f}"]])
    distances = _distances(found)
    if distances:
        yield ""
        yield from aligned([["objects at [m]", *distances], ["", *(str(each) for each in distances.values())]])


def _quantities(found: Inspection) -> dict[str, dict[str, float]]:
    """A summary of each quantity of camera and lens: its least, median and largest value and so on."""
    values = {
        "camera height [m]": [each.height for each in found.facts],
        "camera pitch [deg]": [math.degrees(each.pitch) for each in found.facts],
        "camera roll [deg]": [math.degrees(each.roll) for each in found.facts],
        "focal length [px]": [each.focal_length for each in found.facts],
        "field of view [deg]": [math.degrees(each.fov) for each in found.facts],
    }
    return {name: summary(each) for name, each in values.items()}


def _distances(found: Inspection) -> dict[str, int]:
    """Numbers of objects by distance; empty if there are none or distances were not measured."""
    distances = [each for facts in found.facts for each in facts.distances]
    if not distances:
        return {}
    counts, _ = np.histogram(distances, [*_EDGES, 1e300, np.inf])
    names = [*(f"{low:g}-{high:g}" for low, high in pairwise(_EDGES)), f"over {_EDGES[-1]:g}", "no plane"]
    return dict(zip(names, counts.tolist(), strict=True))


def as_json(found: Inspection) -> dict[str, Any]:
    """All results, for other programs."""
    return {
        "count": found.count,
        "good": len(found.good),
        "faults": [asdict(each) for each in found.faults],
        "absent": found.absent,
        "pixels": found.pixels | {"unlabeled": sum(each.unlabeled for each in found.facts)},
        "pictures": found.shown,
        "sizes": {f"{width}x{height}": count for (width, height), count in found.sizes.most_common()},
        "lenses": dict(found.lenses.most_common()),
        "quantities": _quantities(found) if found.facts else {},
        "distances": _distances(found),
    }


def complaints(found: Inspection, verbose: bool) -> list[str]:
    """Lines about faulty pictures, one for each kind if not `verbose`, and absent classes; or none."""
    faults = [Finding(_KINDS[each.kind], each.text) for each in found.faults]
    lines = [f"no picture shows class {name}: check its color in the configuration" for name in found.absent]
    return [*finding_lines(faults, verbose, "vm-train check --verbose lists all"), *lines]
