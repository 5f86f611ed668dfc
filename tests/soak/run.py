"""Soak the detector: python -m tests.soak.run [faults] [calls] [connections] [-o build/soak]

It writes a REPORT.txt of each soak into the folder, and ends with status 1 if anything was not as it must be.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from vm_embedded.cli.progress import ProgressBar

from .calls import soak_calls, write_memory
from .connections import soak_connections
from .faults import soak_faults

MOST_GROWTH_MIB, MOST_CHANGE, LEAST_RATE, MOST_LINES = 5.0, 0.02, 0.9, 100
"""Limits: growth of a detector's memory, change of memory over many calls, frame rate, lines logged."""


def run_faults(folder: Path, show: Callable[[float], None]) -> tuple[str, bool]:
    """Soak with camera faults. Returns the report, and whether all is as it must be."""
    report = soak_faults(folder, show=show)
    is_good = not report.unexpected and report.recovered == report.faults and not report.left
    return str(report), is_good and report.growth() <= MOST_GROWTH_MIB


def run_calls(folder: Path, show: Callable[[float], None]) -> tuple[str, bool]:
    """Soak with calls of detect. Returns the report, and whether all is as it must be."""
    report = soak_calls(show=show)
    write_memory(report, folder / "memory.tsv")
    return str(report), report.change <= MOST_CHANGE


def run_connections(folder: Path, show: Callable[[float], None]) -> tuple[str, bool]:
    """Soak with connections. Returns the report, and whether all is as it must be."""
    show(0.0)
    reports = soak_connections(folder)
    is_good = all(
        each.during >= LEAST_RATE * each.before and each.lines < MOST_LINES and not each.unexpected for each in reports
    )
    return "\n".join(map(str, reports)), is_good


SOAKS = {"faults": run_faults, "calls": run_calls, "connections": run_connections}


def main() -> int:
    """Run the soaks. Returns the exit status."""
    parser = argparse.ArgumentParser(description="Soak the detector for about an hour.")
    parser.add_argument("soaks", nargs="*", metavar="SOAK", help=f"of {', '.join(SOAKS)}; default all")
    parser.add_argument("-o", "--output", type=Path, default=Path("build/soak"), help="folder of the reports")
    options = parser.parse_args()
    unknown = set(options.soaks) - set(SOAKS)
    if unknown:
        parser.error(f"unknown soak {', '.join(sorted(unknown))}; choose from {', '.join(SOAKS)}")
    is_good = True
    for name in options.soaks or SOAKS:
        folder = options.output / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        bar = ProgressBar(1000, name, unit="parts")
        report, passed = SOAKS[name](folder, lambda part, bar=bar: bar.show(int(1000 * part)))
        bar.clear()
        report += f"\n  {'as it must be' if passed else 'NOT as it must be'}"
        (folder / "REPORT.txt").write_text(report + "\n")
        print(report, flush=True)
        is_good = is_good and passed
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
