"""Fuzz what reads outside inputs: python -m tests.fuzz.run [TARGET...] [--seconds 60] [--runs N] [--seed 1]

Each target is a module of this folder with a function run(bytes), which may only raise VisualMeshError. A process of
its own works on the inputs, and this one watches it. Another error, a line on standard output or standard error, 2 s
of work or 300 MiB more memory is a finding: its input and what happened are saved in build/fuzz/TARGET/findings.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from .inputs import MOST_MEMORY
from .shared_input import MOST_BYTES, SharedInput

CHECKOUT = Path(__file__).resolve().parents[2]
CORPORA = Path(__file__).with_name("corpus")
TARGETS = (
    "model",
    "lens",
    "toml",
    "poses",
    "picture",
    "mjpeg",
    "control",
    "web",
    "checkpoint",
    "bundle",
    "names",
    "shards",
    "boxes",
)

_LONGEST_WORK, _LONGEST = 2.0, 20.0
"""Processor time of an input that counts as a hang, and time that does on a busy machine or if it sleeps [s]."""

_LONGEST_START = 300.0
"""Time for all imports and the first input [s]."""

_LIVES = {"web": 10_000}
"""Inputs after which another process goes on. For a request of the web, atheris itself keeps 17 kB; the same requests
without it leave almost nothing behind, which a test shows."""

_MOST_FINDINGS = 10


@dataclass
class Report:
    """What became of a target. findings: the files with the inputs; their text is beside them."""

    target: str
    inputs: int = 0
    seconds: float = 0.0
    findings: list[Path] = field(default_factory=list)

    def __str__(self) -> str:
        rate = self.inputs / max(self.seconds, 1e-9)
        counts = f"{self.inputs} inputs in {self.seconds:.0f} s ({rate:.0f}/s)"
        return "\n  ".join([f"{self.target}: {counts}, findings: {len(self.findings)}", *map(str, self.findings)])


def fuzz(
    target: str,
    folder: Path,
    seconds: float | None = None,
    runs: int | None = None,
    seed: int = 1,
    corpus: Path | None = None,
) -> Report:
    """Fuzz a target for some time [s] or for a number of inputs, and save in a folder what was found."""
    report = Report(target)
    began, lives = time.monotonic(), 0
    for part in ("corpus", "findings"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    while len(report.findings) < _MOST_FINDINGS:
        left = None if seconds is None else seconds - (time.monotonic() - began)
        runs_left = None if runs is None else runs - report.inputs
        if (left is not None and left < 1.0) or (runs_left is not None and runs_left < 1):
            break
        flags = [f"-seed={seed + lives}", f"-max_len={MOST_BYTES}"]
        flags += [] if left is None else [f"-max_total_time={int(left)}"]
        limits = [each for each in (runs_left, _LIVES.get(target)) if each is not None]
        flags += [f"-runs={min(limits)}"] if limits else []
        lives += 1
        shared, text = _watched(target, folder, corpus or CORPORA / target, flags)
        report.inputs += shared.count
        if not text:
            if target in _LIVES:
                continue
            break
        found = _saved(folder / "findings", shared.input, text)
        if found in report.findings:  # of the corpus, so that nothing else is ever reached
            break
        report.findings.append(found)
    report.seconds = time.monotonic() - began
    return report


def _watched(target: str, folder: Path, corpus: Path, flags: list[str]) -> tuple[SharedInput, str]:
    """Run a process until it ends, hangs or grows. Return its input, and what it was found to do, if anything."""
    shared_file, log = folder / "input", folder / "log"
    shared_file.unlink(missing_ok=True)
    shared = SharedInput(shared_file)
    options = [
        f"-timeout={10**6}",
        "-rss_limit_mb=0",
        f"-report_slow_units={10**6}",
        "-detect_leaks=0",
        "-print_final_stats=0",
    ]
    dictionary = CORPORA / f"{target}.dict"
    options += [f"-dict={dictionary}"] if dictionary.exists() else []
    command = [sys.executable, "-m", "tests.fuzz.child", f"tests.fuzz.{target}", str(shared_file), str(corpus)]
    command += [*flags, *options, str(folder / "corpus"), str(corpus)]
    # The hash seed, because the order of sets would change which lines are reached first.
    environment = os.environ | {"PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with log.open("wb") as output:
        process = subprocess.Popen(command, cwd=CHECKOUT, env=environment, stdout=output, stderr=output)
        try:
            trouble = _watch(process, shared)
        finally:
            process.kill()
            process.wait()
    if not trouble and process.returncode:
        trouble = f"ended with status {process.returncode}\n{log.read_text(errors='replace')[-4000:]}"
    return shared, trouble


def _watch(process: subprocess.Popen[bytes], shared: SharedInput) -> str:
    """Wait until a process ends; what it does too long or with too much memory, if it does."""
    count, since, work = 0, time.monotonic(), 0.0
    while process.poll() is None:
        time.sleep(0.1)
        try:
            now_work, memory = _use(process.pid)
        except (OSError, IndexError):  # it has just ended
            continue
        if shared.count != count:
            count, since, work = shared.count, time.monotonic(), now_work
        waited = time.monotonic() - since
        if shared.memory and (now_work - work > _LONGEST_WORK or waited > _LONGEST):
            return f"works for {now_work - work:.1f} s, and has not ended after {waited:.1f} s"
        if shared.memory and memory > shared.memory + MOST_MEMORY:
            return f"uses {(memory - shared.memory) >> 20} MiB more memory"
        if waited > _LONGEST_START:
            return f"has not started after {_LONGEST_START:.0f} s"
    return ""


def _use(process: int) -> tuple[float, int]:
    """Processor time [s] and memory [bytes] of a process."""
    times = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13]
    pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    return sum(map(int, times)) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGESIZE")


def _saved(folder: Path, data: bytes, text: str) -> Path:
    path = folder / hashlib.sha256(data).hexdigest()[:12]
    path.write_bytes(data)
    path.with_suffix(".txt").write_text(text)
    return path


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.run", description=__doc__.partition("\n")[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"default: all of {', '.join(TARGETS)}")
    parser.add_argument("--seconds", type=float, default=60.0, help="time for each target; default %(default)g")
    parser.add_argument("--runs", type=int, help="number of inputs for each target, instead of a time")
    parser.add_argument("--seed", type=int, default=1, help="default %(default)s")
    options = parser.parse_args()
    for each in options.targets:
        if each not in TARGETS:
            parser.error(f"unknown target {each!r} (allowed: {', '.join(TARGETS)})")
    found = 0
    for each in options.targets or TARGETS:
        seconds = None if options.runs else options.seconds
        report = fuzz(each, CHECKOUT / "build" / "fuzz" / each, seconds, options.runs, options.seed)
        print(report, flush=True)
        found += len(report.findings)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
