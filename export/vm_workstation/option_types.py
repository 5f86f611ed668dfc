"""Options and types of options that several programs share."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def at_least(least: int) -> Callable[[str], int]:
    """A type of argparse for whole numbers from `least` up. It raises ArgumentTypeError for any other text."""

    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least {least}")
        return int(text)

    return parse


def add_set(made: argparse._ActionsContainer, example: str) -> None:
    """Add --set, which overrides entries of a configuration. example: shown in the help, such as mesh.radius=0.07."""
    made.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.ENTRY=VALUE",
        help=f"override an entry: {example}; repeatable",
    )


def add_device(made: argparse._ActionsContainer) -> None:
    """Add --device: what trains."""
    devices = ("auto", "cpu", "cuda")
    made.add_argument("--device", choices=devices, default="auto", help="default: a GPU if there is one, else the CPU")
