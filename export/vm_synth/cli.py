"""vm-synth: render training pictures, look at them and check them."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.files import atomic_write, check_writable
from vm_workstation.contact_sheet import check_sheet_path, choose_indices, write_sheet
from vm_workstation.option_types import at_least
from vm_workstation.stopping import stoppable

from .dataset.contact_sheet import cell, read_shown, sheet
from .dataset.files import Plan, digest, indices_in, is_done, shard_of
from .dataset.inspection import indices_of, inspect
from .dataset.plots import load_matplotlib, plot
from .dataset.report import as_json, complaints, tables
from .dataset.workers import Done, Job, render_all
from .render.mitsuba import find_llvm, load_mitsuba
from .scene.configuration import SceneConfiguration
from .scene.environment import Environment
from .scene.maps import find_maps, missing_held_out

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130

_EXAMPLE = "camera.picture_width=1280"

_EPILOG = """\
other commands, each with a --help of its own:
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
    made.add_argument("--count", type=at_least(0), required=True, metavar="N", help="pictures in the whole set")
    made.add_argument("--hdri", type=Path, required=True, metavar="DIR", help="folder of maps (.hdr, .exr, .pfm)")
    made.add_argument("--seed", type=at_least(0), default=0, metavar="S", help="same seed, same pictures; default 0")
    made.add_argument("--config", type=Path, metavar="FILE", help="scene.toml; what it leaves out keeps its default")
    made.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.ENTRY=VALUE",
        help=f"override an entry of the configuration, as in --set {_EXAMPLE}; give it once for each",
    )
    made.add_argument("--workers", type=at_least(0), metavar="W", help="processes, of one core each; default all cores")
    made.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="render only part I of N, 1 to N")
    made.add_argument("--held-out", action="store_true", help="render only the maps that are held out for testing")
    return made


def preview_parser() -> argparse.ArgumentParser:
    """The options of vm-synth preview OUT."""
    made = argparse.ArgumentParser(
        prog="vm-synth preview",
        description="Draw a contact sheet of a set: each picture as it is, and below it the same picture with its "
        "classes tinted and the ball's outline as its true place, lens and pose give it, not as it was rendered. "
        "Small balls are shown magnified too. A set that is still being rendered can be looked at.",
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder of the set")
    made.add_argument("--count", type=at_least(1), default=24, metavar="N", help="pictures to show; default 24")
    made.add_argument("--columns", type=at_least(1), default=6, metavar="N", help="pictures in a row; default 6")
    made.add_argument("--width", type=at_least(1), default=320, metavar="PX", help="width of each picture; default 320")
    which = made.add_mutually_exclusive_group()
    which.add_argument(
        "--first", type=at_least(0), metavar="I", help="show number I and those after it; default all over"
    )
    which.add_argument("--seed", type=at_least(0), metavar="S", help="choose by chance; same seed, same choice")
    made.add_argument("--output", type=Path, metavar="FILE", help="a .jpg or .png; default OUT/preview.jpg")
    return made


def check_parser() -> argparse.ArgumentParser:
    """The options of vm-synth check OUT."""
    made = argparse.ArgumentParser(
        prog="vm-synth check",
        description="Read all of a set back: how much of it is there, which files are missing or broken, and what the "
        "pictures show. Exit status 0 if the set is complete and sound, else 1.",
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder of the set")
    made.add_argument("--quick", action="store_true", help="read only lenses and truth, no images and masks")
    made.add_argument("--shards", type=at_least(1), default=1, metavar="N", help="count each of N shards by itself")
    made.add_argument("--plots", type=Path, metavar="FILE", help="histograms; .png, .svg or .pdf; needs matplotlib")
    made.add_argument("--json", type=Path, metavar="FILE", help="all findings, and the numbers of each picture")
    return made


def config_parser() -> argparse.ArgumentParser:
    """The options of vm-synth config: none."""
    return argparse.ArgumentParser(
        prog="vm-synth config",
        description="Write a scene.toml with all entries, their meanings, units, limits and defaults.",
    )


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by what is typed."""
    return {each.prog: each for each in (parser(), preview_parser(), check_parser(), config_parser())}


def _shard(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text!r} is no shard; write I/N with I from 1 to N, as in 1/4")
    return int(number), int(count)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-synth and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    commands = {"preview": _preview, "check": _check, "config": _config}
    command = given[0] if given[:1] and given[0] in commands else None
    try:
        with stoppable():
            if command is not None:
                return commands[command](parsers()[f"vm-synth {command}"].parse_args(given[1:]))
            return _render(parser().parse_args(given))
    except VisualMeshError as error:
        print(f"vm-synth: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_FAILED
    except KeyboardInterrupt:
        print("vm-synth: stopped" + "; the same command goes on from here" * (command is None), file=sys.stderr)
        return EXIT_INTERRUPTED


def _render(options: argparse.Namespace) -> int:
    workers = len(os.sched_getaffinity(0)) if options.workers is None else options.workers
    if workers < 1 or options.count < 1:
        raise InputError("--workers and --count must be at least 1")
    configuration = read_sections(SceneConfiguration, options.config, parse_overrides(options.set, _EXAMPLE))
    find_llvm()
    chosen_maps = find_maps(options.hdri, configuration.maps, options.held_out)
    missing = missing_held_out(options.hdri, configuration.maps)
    if missing:
        print(f"vm-synth: held out, but not in {options.hdri}: {', '.join(missing)}", file=sys.stderr)
    maps = _good_maps(chosen_maps, configuration)
    load_mitsuba()
    if configuration.ground.photographed and not any(path.stem in configuration.maps.floors for path in maps):
        print("vm-synth: no map has an entry in [maps.floors], so all pictures are on fields", file=sys.stderr)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't make folder {options.out}: {error.strerror or error}") from error
    Plan(options.seed, options.count, configuration, {path.stem: digest(path) for path in maps}).write(options.out)

    own = shard_of(range(options.count), *options.shard)
    left = [index for index in own if not is_done(options.out, index)]
    if len(left) < len(own):
        print(f"vm-synth: {len(own) - len(left)} of {len(own)} pictures are there already", file=sys.stderr)
    bar, memory = ProgressBar(len(left), "vm-synth"), 0

    def report(done: Done) -> None:
        nonlocal memory
        memory = max(memory, done.memory)
        bar.advance()

    try:
        render_all(Job(options.out, tuple(maps), options.seed, configuration), left, workers, report)
    finally:
        bar.clear()
        if bar.done:
            print(
                f"vm-synth: {bar.done} pictures in {bar.elapsed:.0f} s, "
                f"{3600.0 * bar.done / bar.elapsed:.0f} an hour; {memory / 2**20:.0f} MiB a worker at most",
                file=sys.stderr,
            )
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


def _preview(options: argparse.Namespace) -> int:
    output = options.out / "preview.jpg" if options.output is None else options.output
    check_sheet_path(output)
    if not options.out.is_dir():
        raise InputError(f"there is no folder {options.out}")
    check_writable(output)
    there = indices_in(options.out)
    cells = []
    for index in choose_indices(there, options.count, options.first, options.seed):
        try:
            cells.append(cell(read_shown(options.out, index), options.width))
        except InputError as error:
            print(f"vm-synth: skipped {error}", file=sys.stderr)
    if not cells:
        after = "" if options.first is None else f" from number {options.first} on"
        raise InputError(f"{options.out} has no pictures that can be shown{after}")
    made = sheet(cells, options.columns, f"{options.out.resolve().name}: {len(cells)} of {len(there)} pictures")
    write_sheet(output, made)
    print(f"{output}: {len(cells)} pictures")
    return EXIT_OK


def _check(options: argparse.Namespace) -> int:
    for path in (options.plots, options.json):
        if path is not None:
            check_writable(path)
    if options.plots is not None:
        load_matplotlib(options.plots)
    bar = ProgressBar(len(indices_of(options.out)[2]), "vm-synth")
    try:
        found = inspect(options.out, options.quick, bar.advance)
    finally:
        bar.clear()
    print(tables(found, options.shards))
    if options.json is not None:
        with atomic_write(options.json) as part:
            part.write_text(json.dumps(as_json(found), indent=1) + "\n", encoding="utf-8")
    if options.plots is not None and found.facts:
        title = f"{options.out.resolve().name}: {len(found.facts)} of {found.count} pictures"
        plot(found.facts, found.size, title, options.plots)
    for line in complaints(found):
        print(f"vm-synth: {line}", file=sys.stderr)
    return EXIT_OK if found.good else EXIT_FAILED


def _config(options: argparse.Namespace) -> int:
    print(to_commented_toml(SceneConfiguration()), end="")
    return EXIT_OK
