"""vm-train shards: a folder of pictures as tar shards."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.cli.progress import ProgressBar
from vm_workstation.option_types import at_least

from ..data.pictures import find_pictures
from ..formats.shards import write_shards


def shards_parser() -> argparse.ArgumentParser:
    """The options of vm-train shards DATA OUT."""
    made = Parser(
        prog="vm-train shards",
        description="Write a folder of pictures as tar files in the format of webdataset. vm-train reads them "
        "directly, also as a stream. To continue a run that was stopped, repeat the command.",
    )
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")
    made.add_argument("out", type=Path, metavar="OUT", help="folder to write to; created if missing")
    made.add_argument("--size", type=at_least(1), default=1000, metavar="N", help="pictures per shard; default 1000")
    return made


def run_shards(options: argparse.Namespace) -> int:
    """Write shards as the options say and return the exit status. Raises InputError as write_shards does."""
    pictures = find_pictures(options.data)
    bar = ProgressBar(len(pictures), "vm-train")
    try:
        shards = write_shards(pictures, options.out, options.size, bar.advance)
    finally:
        bar.clear()
    there = len(pictures) - bar.done
    if there:
        print(f"vm-train: {there} pictures were there already", file=sys.stderr)
    print(f"{options.out}: {len(pictures)} pictures in {len(shards)} shards")
    return EXIT_OK
