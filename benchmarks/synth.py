"""Speed and memory of vm-synth: `make bench-synth HDRI=...`.

Renders the same small set with one worker and with two, each in a fresh folder, and writes benchmarks/synth.json and
the table of docs/synth.md.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.report import DOCS, fill
from vm_embedded.cli.bench import describe_machine

RESULTS = Path(__file__).with_name("synth.json")
PAGE = DOCS / "synth.md"
CONFIG = Path(__file__).parents[1] / "export" / "vm_synth" / "polyhaven.toml"
SUMMARY = re.compile(r"(\d+) pictures in (\d+) s, (\d+) per hour; at most (\d+) MiB per worker")


def rendered(hdri: Path, count: int, workers: int) -> dict[str, int]:
    """Pictures, seconds, pictures per hour and MiB of the largest worker."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "vm_synth", folder, "--count", str(count), "--workers", str(workers)]
        command += ["--hdri", str(hdri), "--seed", "2", "--config", str(CONFIG)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = SUMMARY.search(done.stderr)
    assert found, done.stderr
    return dict(zip(("pictures", "seconds", "an_hour", "mib_a_worker"), map(int, found.groups()), strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hdri", type=Path, help="folder of maps")
    parser.add_argument("--count", type=int, default=200, help="pictures of 640 x 512; default 200")
    options = parser.parse_args()
    runs = {str(workers): rendered(options.hdri, options.count, workers) for workers in (1, 2)}
    RESULTS.write_text(json.dumps({"machine": describe_machine(), "runs": runs}, indent=1) + "\n")
    rows = [
        f"| {workers} | {run['pictures']} | {run['an_hour']} | {run['mib_a_worker']} |" for workers, run in runs.items()
    ]
    heads = ["| workers | pictures | pictures per hour | MiB per worker, at most |", "| ---: | ---: | ---: | ---: |"]
    fill(PAGE, {"throughput": "\n".join([*heads, *rows])})


if __name__ == "__main__":
    main()
