"""vm-synth: render training pictures."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from vm_embedded.errors import InputError, VisualMeshError

from .configuration import SceneConfiguration, documented, read_scene_configuration
from .dataset import Plan, digest, is_done, shard_of
from .environment import Environment, find_maps
from .llvm import find_llvm, load_mitsuba
from .workers import Done, Job, render_all, stoppable

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

_EPILOG = """\
other commands:
  vm-synth preview OUT    a contact sheet of a set's pictures, with masks and the balls' true outlines
  vm-synth check OUT      what a set holds, as tables and plots, and which files are missing or damaged
  vm-synth config         all entries of scene.toml with their meanings, units, limits and defaults

A run that was stopped goes on with the same command. Shards may write to one folder or to folders of their own whose
files are then put together.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-synth OUT."""
    made = argparse.ArgumentParser(
        prog="vm-synth",
        description="Render pictures of a ball under 360 degree photographs, with masks, lens, pose and truth.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder to write to; made if it is not there")
    made.add_argument("--count", type=_whole, required=True, metavar="N", help="pictures in the whole set")
    made.add_argument("--hdri", type=Path, required=True, metavar="DIR", help="folder of maps (.hdr, .exr, .pfm)")
    made.add_argument("--seed", type=_whole, default=0, metavar="S", help="same seed, same pictures; default 0")
    made.add_argument("--config", type=Path, metavar="FILE", help="scene.toml; what it leaves out keeps its default")
    made.add_argument("--workers", type=_whole, metavar="W", help="processes, of one core each; default all cores")
    made.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="render only part I of N, 1 to N")
    made.add_argument("--held-out", action="store_true", help="render only the maps that are held out for testing")
    return made


def _whole(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number")
    return int(text)


def _shard(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text!r} is no shard; write I/N with I from 1 to N, as in 1/4")
    return int(number), int(count)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-synth and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with stoppable():
            if given[:1] == ["config"]:
                print("\n".join(documented(SceneConfiguration())))
                return EXIT_OK
            return _render(parser().parse_args(given))
    except VisualMeshError as error:
        print(f"vm-synth: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        print("vm-synth: stopped; the same command goes on from here", file=sys.stderr)
        return EXIT_INTERRUPTED


def _render(options: argparse.Namespace) -> int:
    workers = len(os.sched_getaffinity(0)) if options.workers is None else options.workers
    if workers < 1 or options.count < 1:
        raise InputError("--workers and --count must be at least 1")
    configuration = read_scene_configuration(options.config)
    find_llvm()
    maps = _good_maps(find_maps(options.hdri, configuration.maps, options.held_out), configuration)
    load_mitsuba()
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't make folder {options.out}: {error.strerror or error}") from error
    Plan(options.seed, options.count, configuration, {path.stem: digest(path) for path in maps}).write(options.out)

    own = shard_of(range(options.count), *options.shard)
    left = [index for index in own if not is_done(options.out, index)]
    if len(left) < len(own):
        print(f"vm-synth: {len(own) - len(left)} of {len(own)} pictures are there already", file=sys.stderr)
    ticker = Ticker(len(left))
    try:
        render_all(Job(options.out, tuple(maps), options.seed, configuration), left, workers, ticker.count)
    finally:
        ticker.end()
    print(f"{options.out}: {len(own)} pictures")
    return EXIT_OK


def _good_maps(paths: Sequence[Path], configuration: SceneConfiguration) -> list[Path]:
    """Maps that can be rendered; others are named and left out. Raises InputError if none is left."""
    good = []
    for path in paths:
        try:
            Environment.read(path, configuration.maps)
        except InputError as error:
            print(f"vm-synth: skipped {error}", file=sys.stderr)
        else:
            good.append(path)
    if not good:
        raise InputError("no map is left that can be rendered")
    return good


class Ticker:
    """Progress with the time left: a bar at a terminal, else a line a minute for logs."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._memory = total, 0, 0
        self._terminal = sys.stderr.isatty()
        self._start = self._shown = time.monotonic()

    def count(self, done: Done) -> None:
        self._done += 1
        self._memory = max(self._memory, done.memory)
        now = time.monotonic()
        if self._terminal:
            filled = 30 * self._done // self._total
            print(
                f"\r[{'#' * filled}{'.' * (30 - filled)}] {self._text(now)}\x1b[K", end="", file=sys.stderr, flush=True
            )
        elif now - self._shown >= 60.0:
            self._shown = now
            print(f"vm-synth: {self._text(now)}", file=sys.stderr, flush=True)

    def _text(self, now: float) -> str:
        rate = self._done / max(now - self._start, 1e-9)
        left = int((self._total - self._done) / rate)
        return f"{self._done}/{self._total}, {left // 3600}:{left // 60 % 60:02d}:{left % 60:02d} left"

    def end(self) -> None:
        if self._terminal and self._done:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
        if self._done:
            took = time.monotonic() - self._start
            print(
                f"vm-synth: {self._done} pictures in {took:.0f} s, {3600.0 * self._done / took:.0f} an hour; "
                f"{self._memory / 2**20:.0f} MiB a worker at most",
                file=sys.stderr,
            )
