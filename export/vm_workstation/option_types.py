"""Types of options that several programs share, and readers of their texts."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size


def at_least(least: int) -> Callable[[str], int]:
    """A type of argparse for whole numbers from `least` up. It raises ArgumentTypeError for any other text."""

    def parse(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of at least {least}")
        return int(text)

    return parse


def parse_size(text: str) -> Size:
    """Width and height [px] from text such as 640x512. Raises InputError."""
    width, cross, height = text.partition("x")
    sides = [int(each) if each.isascii() and each.isdigit() else 0 for each in (width, height)]
    if not cross or not all(sides):
        raise InputError(f"size must be WIDTHxHEIGHT in pixels, as 640x512, not {text!r}")
    return sides[0], sides[1]
