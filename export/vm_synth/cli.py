"""vm-synth: renders training pictures, previews them and checks them.

The module is long because it holds the options and the steps of all four commands.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from vm_embedded.borders.text import to_json
from vm_embedded.cli.program import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_OK, Parser, program
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError, VisualMeshError, unknown
from vm_embedded.files import check_writable, write_file
from vm_workstation.contact_sheet import check_sheet_path, choose_indices, write_sheet
from vm_workstation.option_types import add_set, at_least
from vm_workstation.stopping import stoppable
from vm_workstation.worker_process import check_shared_memory

from .dataset.assets import asset_files, read_assets
from .dataset.contact_sheet import cell, object_name, read_labeled, sheet
from .dataset.files import files_in, indices_in, is_done
from .dataset.inspection import inspect, read_checked_plan
from .dataset.plan import Plan, digest, shard_of
from .dataset.plots import load_matplotlib, plot
from .dataset.report import as_json, problems, tables
from .dataset.training_file import write_training
from .dataset.workers import FinishedPicture, Job, render_all
from .render.mitsuba import find_llvm, load_mitsuba
from .scene.configuration import HEADER, SceneConfiguration
from .scene.environment import Environment
from .scene.maps import find_maps, missing_held_out
from .scene.rooms import HELD_OUT_ROOMS, ROOMS, room_name

_EXAMPLE = "camera.picture_width=1280"

_EXAMPLES = ("cups", "cones", "soccer", "varied", "polyhaven")
"""Configurations in the folder of this module."""

_EPILOG = """\
other commands, each with its own --help:
  vm-synth preview OUT    draw a contact sheet with masks and true outlines
  vm-synth check OUT      describe the set in tables and plots; find missing and damaged files
  vm-synth config         print all entries of scene.toml with meaning, unit, limits and default

To continue a stopped run, repeat the command.
Shards can write to one folder, or to several folders; then copy all files into one.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-synth OUT."""
    made = Parser(
        commands=("preview", "check", "config"),
        prog="vm-synth",
        description="Render pictures of a ball, or of another object on a table or floor, lit by 360 degree "
        "photographs. Each has masks, lens, camera pose and the true positions of the objects.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("out", type=Path, metavar="OUT", help="output folder; created if missing")
    made.add_argument(
        "--count", type=at_least(0), required=True, metavar="N", help="number of pictures in the whole set"
    )
    made.add_argument(
        "--hdri",
        type=Path,
        metavar="DIR",
        help="folder of environment maps: .hdr, .exr, .pfm; default: built-in rooms, which look less real",
    )
    made.add_argument("--seed", type=at_least(0), default=0, metavar="S", help="random seed; default 0")
    made.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help=f"scene.toml; missing entries keep their defaults; {', '.join(_EXAMPLES[:-1])} and {_EXAMPLES[-1]} come "
        "with the package",
    )
    add_set(made, _EXAMPLE)
    made.add_argument(
        "--workers", type=at_least(0), metavar="W", help="worker processes, one core each; default: all cores"
    )
    made.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="render only part I of N")
    made.add_argument(
        "--held-out", action="store_true", help="render with only the maps of [maps] held_out; default: with all others"
    )
    return made


_COLUMNS, _WIDTH = 6, 320
"""Pictures in a row of a contact sheet, and their width [px]."""


def preview_parser() -> argparse.ArgumentParser:
    """The options of vm-synth preview OUT."""
    made = Parser(
        prog="vm-synth preview",
        description="Draw a contact sheet of a set. Below each picture is a copy with tinted classes and outlines of "
        "the objects to detect. They are computed from position, lens and pose, not from the rendered mask. A single "
        "small object is also magnified. It also works while the set is rendering.",
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder of the set")
    made.add_argument("--count", type=at_least(1), default=24, metavar="N", help="number of pictures; default 24")
    which = made.add_mutually_exclusive_group()
    which.add_argument(
        "--first",
        type=at_least(0),
        metavar="I",
        help="draw the pictures from I on; default: pictures spread evenly over the set",
    )
    which.add_argument("--seed", type=at_least(0), metavar="S", help="choose random pictures with this seed")
    made.add_argument("--output", type=Path, metavar="FILE", help="output file, .jpg or .png; default OUT/preview.jpg")
    return made


def check_parser() -> argparse.ArgumentParser:
    """The options of vm-synth check OUT."""
    made = Parser(
        prog="vm-synth check",
        description="Read a whole set: report missing and damaged files, and what the pictures show. "
        "Exit status 0 if the set is complete and valid, else 1.",
    )
    made.add_argument("out", type=Path, metavar="OUT", help="folder of the set")
    made.add_argument("--quick", action="store_true", help="skip images and masks")
    made.add_argument(
        "--plots", type=Path, metavar="FILE", help="write histograms to a .png, .svg or .pdf; needs matplotlib"
    )
    made.add_argument(
        "--json", type=Path, metavar="FILE", help="write all findings and the numbers of each picture as JSON"
    )
    return made


def config_parser() -> argparse.ArgumentParser:
    """The options of vm-synth config."""
    made = Parser(
        prog="vm-synth config",
        description="Print a scene.toml with all entries, their meanings, units, limits and defaults.",
    )
    made.add_argument(
        "--example",
        choices=_EXAMPLES,
        help="print this configuration of the package instead, with only the entries that it sets",
    )
    return made


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by the command that a user types."""
    return {each.prog: each for each in (parser(), preview_parser(), check_parser(), config_parser())}


def _shard(text: str) -> tuple[int, int]:
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count)):
        raise argparse.ArgumentTypeError(f"{text!r} is not a shard; write I/N with I from 1 to N, for example 1/4")
    return int(number), int(count)


@program
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
        print("vm-synth: stopped" + "; repeat the command to continue" * (command is None), file=sys.stderr)
        return EXIT_INTERRUPTED


def _scene_file(given: Path | None) -> Path | None:
    """The file of --config: the user's, or else the one of the package, with or without .toml.

    Raises InputError for a name that is neither.
    """
    if given is None or given.exists() or given.parent != Path():
        return given
    if given.name.removesuffix(".toml") not in _EXAMPLES:
        raise InputError(
            f"can't read {given}: there is no such file, and {unknown('configuration', str(given), _EXAMPLES)}"
        )
    return Path(__file__).with_name(given.name.removesuffix(".toml") + ".toml")


def _render(options: argparse.Namespace) -> int:
    """Render the pictures that are missing."""
    workers = len(os.sched_getaffinity(0)) if options.workers is None else options.workers
    if workers < 1 or options.count < 1:
        name, value = ("--workers", workers) if workers < 1 else ("--count", options.count)
        raise InputError(f"{name} must be at least 1, not {value}")
    check_shared_memory()
    job = _begin(options)
    own = shard_of(range(options.count), *options.shard)
    left = [index for index in own if not is_done(options.out, index)]
    if len(left) < len(own):
        print(f"vm-synth: {len(own) - len(left)} of {len(own)} pictures already exist", file=sys.stderr)
    bar, memory = ProgressBar(len(left), "vm-synth"), 0

    def report(finished: FinishedPicture) -> None:
        nonlocal memory
        memory = max(memory, finished.memory)
        bar.advance()

    try:
        render_all(job, left, workers, report)
    finally:
        bar.clear()
        if bar.done:
            print(
                f"vm-synth: {bar.done} pictures in {bar.elapsed:.0f} s, "
                f"{3600.0 * bar.done / bar.elapsed:.0f} per hour; at most {memory / 2**20:.0f} MiB per worker",
                file=sys.stderr,
            )
    print(f"{options.out}: {len(own)} pictures")
    return EXIT_OK


def _begin(options: argparse.Namespace) -> Job:
    """Check all inputs, and write the plan of the set, or compare it with the one that is there. Raises InputError."""
    configuration = read_sections(
        SceneConfiguration, _scene_file(options.config), parse_overrides(options.set, _EXAMPLE)
    )
    find_llvm()
    maps = _maps(options, configuration)
    rooms = () if maps else tuple(HELD_OUT_ROOMS if options.held_out else ROOMS)
    load_mitsuba()
    on_field = configuration.object.is_ball and configuration.ground.photographed
    if maps and on_field and not any(path.stem in configuration.maps.floors for path in maps):
        print("vm-synth: none of the maps has an entry in [maps.floors], so all pictures show a field", file=sys.stderr)
    read_assets(configuration)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't create folder {options.out}: {error.strerror or error}") from error
    lights = {path.stem: digest(path) for path in maps} or {room_name(each): "built in" for each in rooms}
    files = {str(path): digest(path) for path in asset_files(configuration)}
    Plan(options.seed, options.count, configuration, lights, files).write(options.out)
    if not configuration.object.is_ball:
        write_training(options.out, configuration)
    return Job(options.out, tuple(maps), options.seed, configuration, rooms)


def _maps(options: argparse.Namespace, configuration: SceneConfiguration) -> list[Path]:
    """The maps that light the scenes, of the folder --hdri; none without the option. Raises InputError."""
    if options.hdri is None:
        return []
    found = find_maps(options.hdri, configuration.maps, options.held_out)
    missing = missing_held_out(options.hdri, configuration.maps)
    if missing:
        print(f"vm-synth: held-out maps that are not in {options.hdri}: {', '.join(missing)}", file=sys.stderr)
    return _valid_maps(found, configuration)


def _valid_maps(paths: Sequence[Path], configuration: SceneConfiguration) -> list[Path]:
    """The valid maps; the others are reported and skipped. Raises InputError if there is no valid map."""
    good = []
    for path in paths:
        try:
            Environment.read(path, configuration.maps)
        except InputError as error:
            print(f"vm-synth: skipped {error}", file=sys.stderr)
        else:
            good.append(path)
    if not good:
        raise InputError("none of the maps can be read")
    return good


def _preview(options: argparse.Namespace) -> int:
    output = options.out / "preview.jpg" if options.output is None else options.output
    check_sheet_path(output)
    if not options.out.is_dir():
        raise InputError(f"there is no folder {options.out}")
    check_writable(output, files_in(options.out))
    there = indices_in(options.out)
    cells, name = [], "ball"
    for index in choose_indices(there, options.count, options.first, options.seed):
        try:
            shown = read_labeled(options.out, index)
            cells.append(cell(shown, _WIDTH))
            name = object_name(shown.truth)
        except InputError as error:
            print(f"vm-synth: skipped {error}", file=sys.stderr)
    if not cells:
        after = "" if options.first is None else f" from number {options.first} on"
        raise InputError(f"{options.out} has no complete pictures{after}; run vm-synth check {options.out}")
    made = sheet(cells, _COLUMNS, f"{options.out.resolve().name}: {len(cells)} of {len(there)} pictures", name)
    write_sheet(output, made)
    print(f"{output}: {len(cells)} pictures")
    return EXIT_OK


def _check(options: argparse.Namespace) -> int:
    for path in (options.plots, options.json):
        if path is not None:
            check_writable(path, files_in(options.out))
    if options.plots is not None:
        load_matplotlib(options.plots)
    bar = ProgressBar(len(read_checked_plan(options.out)[2]), "vm-synth")
    try:
        found = inspect(options.out, options.quick, bar.advance)
    finally:
        bar.clear()
    print(tables(found))
    if options.json is not None:
        write_file(options.json, to_json(as_json(found), indent=1) + "\n")
    if options.plots is not None and found.facts:
        title = f"{options.out.resolve().name}: {len(found.facts)} of {found.count} pictures"
        plot(found.facts, found.size, title, options.plots)
    for line in problems(found):
        print(f"vm-synth: {line}", file=sys.stderr)
    return EXIT_OK if found.complete else EXIT_FAILED


def _config(options: argparse.Namespace) -> int:
    if options.example is not None:
        print(Path(__file__).with_name(f"{options.example}.toml").read_text(encoding="utf-8"), end="")
        return EXIT_OK
    print(to_commented_toml(SceneConfiguration(), HEADER), end="")
    return EXIT_OK
