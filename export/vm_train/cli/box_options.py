"""Options of the programs that read folders of boxes: --format and --names."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from vm_embedded.errors import InputError
from vm_workstation.class_names import class_name

from ..boxes.read import FORMATS


def add_box_options(parser: argparse._ActionsContainer) -> None:
    """Add the options that say how to read a folder of boxes."""
    parser.add_argument(
        "--format", choices=tuple(FORMATS), help="format of the boxes; default: the one that is in the folder"
    )
    parser.add_argument(
        "--names",
        nargs="+",
        action="extend",
        default=[],
        metavar="OLD=NEW",
        help="rename classes of the boxes to those of the network, for example 0=ball",
    )


def divided_remark(part: str) -> str:
    """What to say if `hold_out` divided the recordings. part: of the frames."""
    return (
        f"no recording is small enough to be held out as a whole, so the last third of each one is for {part}; "
        "frames of another recording would tell more"
    )


def parse_names(texts: Sequence[str]) -> dict[str, str]:
    """The new names by the old ones, from texts OLD=NEW. Raises InputError for other texts and contradictions."""
    names: dict[str, str] = {}
    for text in texts:
        old, equals, new = (part.strip() for part in text.rpartition("="))
        if not (old and equals and new):
            raise InputError(f"--names {text!r} must be OLD=NEW, for example 0=ball")
        new = class_name(new)
        if names.setdefault(old, new) != new:
            raise InputError(f"--names renames {old!r} to both {names[old]!r} and {new!r}")
    return names
