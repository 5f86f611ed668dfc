"""vm-train check --boxes: facts about the boxes of a folder, faults and remarks, and a contact sheet."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from vm_embedded.borders.text import to_json
from vm_embedded.cli.program import EXIT_OK
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.files import check_writable, write_file
from vm_embedded.network.bundled import DEFAULT, SHIPPED, model_path
from vm_embedded.network.model_file import read_model
from vm_workstation.contact_sheet import check_sheet_path, write_sheet
from vm_workstation.option_types import at_least

from ..boxes.box import BoxedSet
from ..boxes.findings import finding_lines
from ..boxes.read import files_in, read_boxes
from ..boxes.sheet import box_sheet, unusual_first
from ..boxes.summary import classes_of, name_faults, summary_lines
from ..boxes.unlabeled import FoundBox, describe, without_box
from .box_options import add_box_options, parse_names

EXIT_FAULTS = 1

_ON_SHEET = 400
"""Boxes on a contact sheet, if no other number is given."""

_OWN = ("format", "names", "network", "no_look", "sheet", "count")
"""Options that are only for boxes."""

_OTHERS = ("config", "workers", "strict")
"""Options that are only for pictures with masks."""


def add_check_boxes(parser: argparse.ArgumentParser) -> None:
    """Add the options of vm-train check --boxes."""
    group = parser.add_argument_group("images with boxes")
    group.add_argument(
        "--boxes",
        action="store_true",
        help="DATA holds images with boxes in YOLO, Pascal VOC or COCO format; they need neither masks nor lenses",
    )
    add_box_options(group)
    group.add_argument(
        "--network",
        metavar="MODEL",
        help="network whose objects the boxes should show: a checkpoint (.pt), a model file (.onnx), or a network of "
        f"the package ({', '.join(SHIPPED)}); default {DEFAULT}",
    )
    group.add_argument(
        "--no-look",
        action="store_true",
        help="do not look for objects without a box, which takes about 0.2 s for each image",
    )
    group.add_argument(
        "--sheet", type=Path, metavar="FILE", help="draw the boxes of the objects of --network to a .jpg or .png"
    )
    group.add_argument(
        "--count", type=at_least(1), metavar="N", help=f"boxes to draw, the most unusual ones; default {_ON_SHEET}"
    )


def refuse_other_options(options: argparse.Namespace) -> None:
    """Raise InputError for an option that has no effect with --boxes, or only with it."""
    for name in _OTHERS if options.boxes else _OWN:
        if getattr(options, name):
            which = "is not for folders of boxes: leave it out" if options.boxes else "needs --boxes"
            raise InputError(f"--{name.replace('_', '-')} {which}")


def run_check_boxes(options: argparse.Namespace) -> int:
    """Check as the options say and return the exit status.

    Raises InputError if the folder has no boxes, or if the results can't be written.
    """
    network = model_path(options.network or DEFAULT)
    for path in filter(None, (options.json, options.sheet)):
        check_writable(path, chain([network], files_in(options.data)))
    if options.sheet is not None:
        check_sheet_path(options.sheet)
    objects, round_names = _objects(network)
    found = read_boxes(options.data, options.format, parse_names(options.names), round_names)
    unlabeled = [] if options.no_look else _unlabeled(found, network, bool(round_names))
    more = (*name_faults(found, objects), *(describe(each, options.data) for each in unlabeled))
    found = replace(found, findings=found.findings + more)
    print("\n".join(summary_lines(found)))
    if options.json is not None:
        write_file(options.json, to_json(_as_json(found), indent=1) + "\n")
    for line in finding_lines(found.findings, options.verbose, "--verbose lists all"):
        print(f"vm-train: {line}", file=sys.stderr)
    if unlabeled:
        print(_advice(len(unlabeled), options.sheet), file=sys.stderr)
    if options.sheet is not None:
        _write_sheet(options, found, objects, unlabeled)
    return EXIT_FAULTS if found.faults else EXIT_OK


def _unlabeled(found: BoxedSet, network: Path, is_round: bool) -> list[FoundBox]:
    """The objects that the network's close look sees clearly where no box is. Raises ModelError."""
    from ..tuning.box_finding import searching_look
    from ..tuning.sightings import clear_sightings

    if network.suffix.lower() != ".onnx":
        return []
    model = read_model(network)
    if model.manifest.searched_class is None:
        return []
    look = searching_look(model)
    bar = ProgressBar(len(found.pictures), "vm-train")
    try:
        sightings = list(clear_sightings(look, found.pictures, is_round, bar.advance))
    finally:
        bar.clear()
    return without_box(found.pictures, sightings)


def _advice(count: int, sheet: Path | None) -> str:
    """What to do about places without a box that look like an object."""
    where = "look at them with --sheet FILE" if sheet is None else f"{sheet} shows them in red"
    places = "1 place looks" if count == 1 else f"{count} places look"
    return f"vm-train: {places} like an object without a box; {where}; only real objects need one, lamps do not"


def _objects(network: Path) -> tuple[list[str], list[str]]:
    """The classes of objects that a network finds, and those of them that look round. Raises InputError, ModelError."""
    from ..evaluation.answers import load_subject

    manifest = load_subject(network, Settings()).manifest
    objects = [each.name for each in manifest.classes if each.kind == "object"]
    return objects, objects if manifest.shape == "sphere" else []


def _write_sheet(
    options: argparse.Namespace, found: BoxedSet, objects: Sequence[str], unlabeled: Sequence[FoundBox]
) -> None:
    places = [place for name in objects for place in unusual_first(found.pictures, name)]
    most = options.count or _ON_SHEET
    chosen = places[:most]
    if not chosen:
        raise InputError(f"can't draw {options.sheet}: there is no box of class {' or '.join(objects)}")
    pictures = {each.image: each for each in found.pictures}
    red = [(pictures[each.image], each.box) for each in unlabeled[:most]]
    write_sheet(options.sheet, box_sheet(chosen, options.data, red))
    also = f"; {len(red)} of {len(unlabeled)} places without a box, in red" if red else ""
    print(f"{options.sheet}: {len(chosen)} of {len(places)} boxes of {', '.join(objects)}{also}")


def _as_json(found: BoxedSet) -> dict[str, Any]:
    """All results, for other programs."""
    return {
        "pictures": len(found.pictures),
        "faults": list(found.faults),
        "remarks": list(found.remarks),
        "classes": classes_of(found),
        "recordings": dict(sorted(Counter(each.recording for each in found.pictures).items())),
        "sizes": {f"{w}x{h}": count for (w, h), count in Counter(each.size for each in found.pictures).most_common()},
    }
