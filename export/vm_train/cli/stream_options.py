"""The options of vm-train that say which shards it streams."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.errors import InputError

from ..learning.configuration import TrainConfiguration

if TYPE_CHECKING:
    from ..graphs.streamed import StreamSource
    from ..learning.hardware import Hardware

_RANGE = re.compile(r"\{(\d+)\.\.(\d+)\}")


def add_stream(made: argparse.ArgumentParser) -> None:
    """Add --stream and --epoch-pictures."""
    group = made.add_argument_group(
        "streaming",
        "Training pictures from shards elsewhere, of which nothing is kept; all pictures of DATA are for validation.",
    )
    group.add_argument(
        "--stream",
        nargs="+",
        default=[],
        metavar="SHARD",
        help="tar files, http addresses or pipe:command, as in 'https://example.org/pictures-{000000..000099}.tar'",
    )
    group.add_argument(
        "--epoch-pictures",
        type=int,
        metavar="N",
        help="pictures in an epoch of the stream, which begins anew with each, in another order",
    )


def stream_source(
    options: argparse.Namespace, configuration: TrainConfiguration, here: Hardware
) -> StreamSource | None:
    """Where training pictures are streamed from, if they are. Raises InputError for options that don't fit."""
    from ..graphs.streamed import StreamSource

    if not options.stream:
        if options.epoch_pictures is not None:
            raise InputError("--epoch-pictures is of a stream: --stream says of which one")
        return None
    if options.epoch_pictures is None:
        raise InputError("--stream needs --epoch-pictures: how long a stream is shows only at its end")
    if options.epoch_pictures < 1:
        raise InputError(f"--epoch-pictures must be at least 1, not {options.epoch_pictures}")
    if options.training or options.validation or options.test:
        raise InputError("--stream takes no lists: all pictures of DATA are for validation")
    if configuration.mesh.radius_of == "scene":
        raise InputError("mesh.radius_of = 'scene' needs sceneX.json, which shards don't have")
    shards = shard_names(options.stream)
    workers = min(here.workers, len(shards) // here.size)
    return StreamSource(shards, options.epoch_pictures, here.size, workers, options.strict)


def shard_names(patterns: Sequence[str]) -> tuple[str, ...]:
    """All shards of patterns with ranges such as pictures-{000000..000099}.tar: http and https addresses, "pipe:" and a
    command of the shell, or files, which become absolute.

    Raises InputError for a range that is none, a file that is not there, and a shard that is named twice.
    """
    found: dict[str, None] = {}
    for name in (each for pattern in patterns for each in _expanded(pattern)):
        absolute = name if name.startswith(("http://", "https://", "pipe:")) else _file(name)
        if absolute in found:
            raise InputError(f"shard {name} is named twice")
        found[absolute] = None
    return tuple(found)


def _expanded(pattern: str) -> list[str]:
    """A pattern with each number of each of its ranges."""
    texts = _RANGE.split(pattern)  # what is between ranges, and the first and last number of each
    ranges = [_numbers(first, last) for first, last in zip(texts[1::3], texts[2::3], strict=True)]
    return [
        texts[0] + "".join(number + text for number, text in zip(numbers, texts[3::3], strict=True))
        for numbers in product(*ranges)
    ]


def _numbers(first: str, last: str) -> list[str]:
    if int(first) > int(last):
        raise InputError(f"the range {{{first}..{last}}} ends before it begins")
    return [f"{number:0{len(first)}d}" for number in range(int(first), int(last) + 1)]


def _file(name: str) -> str:
    if name == "-":
        raise InputError("standard input can't be streamed again in each epoch: name files, addresses or pipe:command")
    if not Path(name).is_file():
        raise InputError(f"there is no shard {name!r}")
    return str(Path(name).resolve())
