"""vm-train import: tar archives of pictures, or TFRecord files of the reference, as a folder of pictures."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vm_embedded.borders.credentials import without_credentials
from vm_embedded.borders.text import printable
from vm_embedded.cli.program import EXIT_OK, Parser
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, unknown

from ..formats.picture_example import KEYS

_SHOWN = 20
"""Skipped pictures to print; a wrong name of a feature skips all of them."""


def import_parser() -> argparse.ArgumentParser:
    """The options of vm-train import FILES... OUT."""
    made = Parser(
        prog="vm-train import",
        description="Unpack tar archives of pictures, or convert TFRecord files of the reference implementation, to a "
        "folder of pictures. Files may be compressed with gzip. Images and masks are copied without any change. What "
        "can't be used is named and skipped. To continue an import that was stopped, repeat the command.",
    )
    made.add_argument(
        "files",
        nargs="+",
        metavar="FILES",
        help="files *.tar or *.tar.gz, web addresses of such files, or - for standard input; others are TFRecord files",
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder to write to; created if missing")
    made.add_argument(
        "--key",
        type=_renamed,
        action="append",
        default=[],
        metavar="OURS=THEIRS",
        help="read our feature OURS from the file's feature THEIRS, for example lens/fov=camera/field_of_view; "
        f"repeatable; OURS is one of {', '.join(KEYS)}",
    )
    made.add_argument(
        "--normalized",
        action="store_true",
        help="TFRecord files give lens/focal_length, lens/centre and lens/k for images of width 1; default: in pixels",
    )
    made.add_argument("--strict", action="store_true", help="fail if a record or picture can't be used")
    return made


def _renamed(text: str) -> tuple[str, str]:
    ours, _, theirs = text.partition("=")
    if not theirs:
        raise argparse.ArgumentTypeError(f"{text!r}: write OURS=THEIRS, for example lens/k=lens/distortion")
    if ours not in KEYS:
        raise argparse.ArgumentTypeError(unknown("key", ours, KEYS))
    return ours, theirs


def run_import(options: argparse.Namespace) -> int:
    """Import as the options say and return the exit status. Raises InputError, also if no picture was imported."""
    from ..formats.importing import import_pictures

    bar = ProgressBar(100, unit="%")
    try:
        result = import_pictures(
            options.files,
            options.out,
            dict(options.key),
            options.normalized,
            options.strict,
            lambda share: bar.show(int(100 * share)),
        )
    finally:
        bar.clear()
    lines = [f"skipped {fault}" for fault in result.skipped[:_SHOWN]]
    if len(result.skipped) > _SHOWN:
        lines.append(f"skipped {len(result.skipped) - _SHOWN} more")
    for line in (*lines, *result.remarks):
        print(f"vm-train: {printable(line)}", file=sys.stderr)
    if not result.count and not result.there:
        raise InputError(f"found no usable picture in {', '.join(map(without_credentials, options.files))}")
    before = f", {result.there} were there already" if result.there else ""
    skipped = f", {len(result.skipped)} skipped" if result.skipped else ""
    print(f"{options.out}: {result.count} pictures imported{before}{skipped}")
    return EXIT_OK
