"""vm-doctor: what is wrong with this machine, and how to mend it."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict

import cv2

from ..errors import VisualMeshError
from .checks import BAD, Finding, safely
from .options import add_live, add_model, add_pose, add_settings, read_options

EXIT_OK, EXIT_FAILED = 0, 1


def parser() -> argparse.ArgumentParser:
    """The command line of vm-doctor: that of vm-detect, whose configuration it looks at."""
    parser = argparse.ArgumentParser(
        prog="vm-doctor",
        description="Look at processor, packages, model, camera, lens and clock, and say what to mend.",
        epilog="Exit status: 0 nothing is in the way, 1 something is, 2 wrong usage.",
    )
    parser.add_argument("--camera", metavar="SOURCE", help="as for vm-detect")
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each finding")
    add_model(parser)
    add_pose(parser, "as for vm-detect")
    add_settings(parser)
    add_live(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-doctor and return its exit status."""
    options = parser().parse_args(arguments)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        configuration = read_options(options)
        worst = EXIT_OK
        for each in safely(configuration):
            print(json.dumps(asdict(each)) if options.json else _shown(each), flush=True)
            worst = EXIT_FAILED if each.state == BAD else worst
    except VisualMeshError as error:
        print(f"vm-doctor: {error}", file=sys.stderr)
        return EXIT_FAILED
    except BrokenPipeError:
        return EXIT_OK
    return worst


def _shown(finding: Finding) -> str:
    mend = f"\n{'':10}mend: {finding.mend}" if finding.mend else ""
    return f"{finding.state:9} {finding.about}: {finding.seen}{mend}"


if __name__ == "__main__":
    sys.exit(main())
