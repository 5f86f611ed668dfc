"""The options of vm-train to stream training pictures from shards."""

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

_MOST_SHARDS, _MOST_DIGITS = 10**6, 20

_RANGE = re.compile(r"\{(\d+)\.\.(\d+)\}")


def add_stream(group: argparse._ArgumentGroup) -> None:
    """Add --stream and --epoch-pictures."""
    group.add_argument(
        "--stream",
        nargs="+",
        default=[],
        metavar="SHARD",
        help="train on tar files, addresses or pipe:COMMAND, {00..99} for 100 of them; DATA is for validation",
    )
    group.add_argument(
        "--epoch-pictures",
        type=int,
        metavar="N",
        help="pictures of the stream in an epoch",
    )


def stream_source(
    options: argparse.Namespace, configuration: TrainConfiguration, hardware: Hardware
) -> StreamSource | None:
    """Where to stream training pictures from, or None. Raises InputError if the options contradict each other."""
    from ..graphs.streamed import StreamSource

    if not options.stream:
        if options.epoch_pictures is not None:
            raise InputError("--epoch-pictures needs --stream, the shards to read")
        return None
    if options.epoch_pictures is None:
        raise InputError("--stream needs --epoch-pictures, because the length of a stream is unknown")
    if options.epoch_pictures < 1:
        raise InputError(f"--epoch-pictures must be at least 1, not {options.epoch_pictures}")
    if options.training or options.validation or options.test:
        raise InputError("--stream can't be combined with lists: all pictures of DATA are for validation")
    if configuration.mesh.radius_of == "scene":
        raise InputError(
            "mesh.radius_of = 'scene' needs sceneX.json, which shards don't hold: use a folder of pictures"
        )
    shards = shard_names(options.stream)
    workers = min(hardware.workers, len(shards) // hardware.size)
    return StreamSource(shards, options.epoch_pictures, hardware.size, workers, options.strict)


def shard_names(patterns: Sequence[str]) -> tuple[str, ...]:
    """The shards of patterns with ranges such as pictures-{000000..000099}.tar; paths of files become absolute.

    A shard is an http or https address, "pipe:" and a shell command, or a file. Raises InputError for a range that ends
    before it begins, a missing file, and a shard that is named twice.
    """
    found: dict[str, None] = {}
    for name in (each for pattern in patterns for each in _expanded(pattern)):
        absolute = name if name.startswith(("http://", "https://", "pipe:")) else _file(name)
        if absolute in found:
            raise InputError(f"shard {name} is named twice")
        found[absolute] = None
    return tuple(found)


def _expanded(pattern: str) -> list[str]:
    """All names that a pattern stands for."""
    texts = _RANGE.split(pattern)  # text, first and last number of a range, text, ...
    ranges = [_numbers(first, last) for first, last in zip(texts[1::3], texts[2::3], strict=True)]
    return [
        texts[0] + "".join(number + text for number, text in zip(numbers, texts[3::3], strict=True))
        for numbers in product(*ranges)
    ]


def _numbers(first: str, last: str) -> list[str]:
    if max(len(first), len(last)) > _MOST_DIGITS or int(last) - int(first) >= _MOST_SHARDS:
        raise InputError(f"the range {{{first[:20]}..{last[:20]}}} has more than {_MOST_SHARDS} shards")
    if int(first) > int(last):
        raise InputError(f"the range {{{first}..{last}}} ends before it begins")
    return [f"{number:0{len(first)}d}" for number in range(int(first), int(last) + 1)]


def _file(name: str) -> str:
    if name == "-":
        raise InputError("standard input can't be read again in each epoch: give files, addresses or pipe:COMMAND")
    if name and Path(name).is_dir():
        example = Path(name) / "pictures-{000000..000009}.tar"
        raise InputError(f"shard {name!r} is a folder: give the tar files in it, as in {example}")
    if not Path(name).is_file():
        raise InputError(f"shard {name!r} does not exist")
    return str(Path(name).resolve())
