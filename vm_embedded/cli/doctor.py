"""vm-doctor: check this machine and the configuration of vm-detect, and say how to fix problems."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict

from ..borders.text import to_json
from ..cameras.library_messages import silence_opencv
from ..errors import VisualMeshError
from .checks import run_checks
from .finding import BAD, Finding
from .options import add_live, add_model, add_pose, add_settings, read_options
from .program import EXIT_FAILED, EXIT_OK, Parser, program


def parser() -> argparse.ArgumentParser:
    """The command line of vm-doctor; it has the options of vm-detect, whose configuration it checks."""
    parser = Parser(
        prog="vm-doctor",
        description="Check processor, packages, model, camera, lens, pose, outputs and clock, and say how to fix "
        "problems. Search frames of the camera, and say how many points, proposals and objects they have.",
        epilog="Exit status: 0 no failure (there may be warnings), 1 at least one failure, 2 wrong usage.",
    )
    parser.add_argument("--camera", metavar="SOURCE", help="as for vm-detect")
    parser.add_argument("--json", action="store_true", help="print each finding as a line of JSON")
    add_model(parser)
    add_pose(parser, "those to check")
    add_settings(parser)
    add_live(parser)
    return parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-doctor and return its exit status."""
    options = parser().parse_args(arguments)
    silence_opencv()
    try:
        configuration = read_options(options)
        worst = EXIT_OK
        for each in run_checks(configuration):
            print(to_json(asdict(each)) if options.json else _as_text(each), flush=True)
            worst = EXIT_FAILED if each.state == BAD else worst
    except VisualMeshError as error:
        print(f"vm-doctor: {error}", file=sys.stderr)
        return EXIT_FAILED
    return worst


def _as_text(finding: Finding) -> str:
    fix = f"\n{'':10}fix: {finding.mend}" if finding.mend else ""
    return f"{finding.state:9} {finding.about}: {finding.seen}{fix}"


if __name__ == "__main__":
    sys.exit(main())
