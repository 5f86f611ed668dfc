"""Compare whole calls with those of another program: `make bench-external PEER='./their-engine --threads 1'`.

The program runs once, on the same core. It reads lines from standard input, and answers each with one line:

    IMAGE<tab>LENS    paths of a picture and of its lens file, which also holds the pose (docs/lens-files.md)
    MILLISECONDS      the time of its whole call on this picture: a number, without reading the files

Ours and theirs take turns, picture by picture. The table shows medians, p99, and the median of the ratios.
"""

from __future__ import annotations

import argparse
import math
import os
import shlex
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np

from vm_embedded import Detector, Settings, VisualMeshError
from vm_embedded.network.bundled import model_path

from .frames import Frame, frames


class ExternalEngine:
    """A running program that answers with its times. Raises SystemExit, with the reason, if it does not."""

    def __init__(self, command: str) -> None:
        self.command = command
        try:
            self._process = subprocess.Popen(
                shlex.split(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
            )
        except (OSError, ValueError, IndexError) as error:
            raise SystemExit(f"can't start {command!r}: {error}") from error

    def milliseconds(self, frame: Frame) -> float:
        """Time of its call on a frame [ms]."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(f"{frame.path}\t{frame.lens_path}\n")
            answer = self._process.stdout.readline()
        except OSError as error:
            raise SystemExit(f"{self.command!r} ended: {error}") from error
        if not answer:
            raise SystemExit(f"{self.command!r} ended with code {self._process.wait()} instead of an answer")
        try:
            time = float(answer)
        except ValueError:
            time = math.nan
        if not 0.0 < time < math.inf:
            raise SystemExit(f"{self.command!r} must answer with milliseconds, such as 1.25, not {answer.strip()!r}")
        return time

    def close(self) -> None:
        """End the program."""
        self._process.kill()
        self._process.communicate()


def compare(engine: ExternalEngine, detector: Detector, work: list[Frame], rounds: int) -> str:
    """A table of times [ms] of both on the same frames. The first round does not count."""
    ours, theirs = np.empty((2, rounds + 1, len(work)))
    for number in range(rounds + 1):
        for column, frame in enumerate(work):
            started = perf_counter()
            detector.detect(frame.image, frame.orientation, frame.lens)
            ours[number, column] = 1e3 * (perf_counter() - started)
            theirs[number, column] = engine.milliseconds(frame)
    ours, theirs = ours[1:], theirs[1:]
    lines = ["| whole call | median [ms] | p99 [ms] |", "| --- | ---: | ---: |"]
    for name, times in (("vm-embedded", ours), (engine.command, theirs)):
        lines.append(f"| {name} | {np.median(times):.2f} | {np.quantile(times, 0.99):.2f} |")
    ratio = np.median(theirs, axis=0) / np.median(ours, axis=0)
    lines.append(f"\ntheirs / ours: {np.median(ratio):.2f}, over all pictures {ratio.min():.2f} to {ratio.max():.2f}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.external", description=__doc__)
    parser.add_argument("command", help="the other program, with its options")
    parser.add_argument("--model", default="ball", help="our network: a name or a file; default ball")
    parser.add_argument("--threads", type=int, default=1, help="our threads, and cores of both; default 1")
    parser.add_argument("--rounds", type=int, default=30, help="rounds over all pictures; default 30")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error(f"--rounds must be at least 1, not {options.rounds}")
    cores = sorted(os.sched_getaffinity(0))
    if not 1 <= options.threads <= len(cores):
        parser.error(f"--threads must be from 1 to {len(cores)}, not {options.threads}")
    os.sched_setaffinity(0, set(cores[-options.threads :]))
    cv2.setNumThreads(1)
    what, work = frames()
    print(f"on {what}, {options.threads} core{'s' * (options.threads > 1)}", file=sys.stderr)
    try:
        detector = Detector.from_file(Path(model_path(options.model)), Settings(threads=options.threads))
    except VisualMeshError as error:
        parser.error(str(error))
    engine = ExternalEngine(options.command)
    try:
        print(compare(engine, detector, work, options.rounds))
    finally:
        engine.close()


if __name__ == "__main__":
    main()
