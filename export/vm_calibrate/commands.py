"""The commands of vm-calibrate."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from vm_embedded.cameras.image_files import open_source
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.config.units import parse_angle, parse_size
from vm_embedded.detection.pose_search import View
from vm_embedded.errors import InputError
from vm_embedded.files import check_not_input, check_writable, write_file
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import format_lens_file, read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.live.configuration import HEADER, Configuration, read_configuration
from vm_embedded.live.top_level_entries import checked_fov
from vm_embedded.output.recorder import CONFIGURATION

from .ball_fit import fit_balls
from .balls import ball_files, read_balls
from .board_on_floor import fit_board_on_floor
from .boards import Board, board_from, board_svg
from .field_pose import FieldFit, fit_field, read_views
from .floor_pose import PoseFit
from .frames import Sighting, choose, find_boards
from .kalibr import read_kalibr
from .lens_fit import LensFit, fit_lens
from .report import field_lines, field_warnings, lens_lines, lens_warnings, pose_lines

_NETWORK = "soccer"
"""The network that sees lines and balls."""

_MOST_PLACES = 30
"""Most frames from which a pose is fitted to a board on the floor."""


def board(options: argparse.Namespace) -> None:
    """Draw a board to print."""
    check_writable(options.output)
    if options.output.suffix.lower() != ".svg":
        raise InputError(
            f"the drawing of a board is an SVG file; give -o a name that ends in .svg, not {options.output}"
        )
    drawn = _board(options, None)
    write_file(options.output, board_svg(drawn))
    print(f"{options.output}: written; print it at 100 %, and check that a square has {1000.0 * drawn.square:g} mm")


def lens(options: argparse.Namespace) -> None:
    """Estimate a lens and write it."""
    _check_lens_path(options.output)
    check_not_input(options.output, open_source(options.source).files)
    fov = None if options.fov is None else parse_angle(options.fov, "--fov")
    if fov is not None and options.lens in ("auto", "pinhole", "fisheye"):
        raise InputError("--fov is for a radial lens; files of pinhole and fisheye lenses have no field of view")
    is_flat = options.lens == "rectilinear"
    if fov is not None and not (0.0 < fov < math.pi if is_flat else 0.0 < fov <= 2.0 * math.pi):
        widest = "below 180deg" if is_flat else "up to 360deg"
        raise InputError(f"--fov of this lens must be above 0 and {widest}, not {options.fov}")
    search = find_boards(options.source, _board(options, 1.0))
    fit = _fit(options.lens, choose(search, options.frames), search.size)
    found = fit.lens if fov is None else replace(fit.lens, fov=fov)
    lines = lens_lines(fit, search.size, search.left_out)
    _write(options.output, found, None, lines)
    _warn(lens_warnings(fit, search.size))


def kalibr(options: argparse.Namespace) -> None:
    """Convert a lens of Kalibr."""
    _check_lens_path(options.output)
    check_not_input(options.output, [options.source])
    name, found = read_kalibr(options.source, options.camera)
    _write(options.output, found, None, [f"lens            {name} of {options.source.name}, from Kalibr"])


def photo(options: argparse.Namespace) -> None:
    """Estimate a pose from one photo; print the options of vm-detect, and write a lens file if asked to."""
    if (options.lens is None) == (options.fov is None):
        raise InputError("give --lens FILE, or --fov ANGLE for a lens without distortion")
    if options.output is not None:
        _check_lens_path(options.output)
        check_not_input(options.output, open_source(options.source).files)
    _check_lengths(options)
    lens = None if options.lens is None else read_lens_file(options.lens).lens
    fov = None if options.fov is None else checked_fov(options.fov)
    views, _ = read_views(options.source, lens, fov, None, most=1)
    fit = fit_field(views, False, _NETWORK, options.radius, options.line_width)
    lines = field_lines(fit, fixed=True)
    if options.output is not None:
        _write(options.output, views[0].lens, fit.orientation, lines)
    else:
        print("\n".join(lines))
    given = f"--fov {options.fov}" if options.lens is None else f"--lens {shlex.quote(str(options.lens))}"
    pose, radius = _pose_options(fit.orientation), _radius_option(options)
    print(f"vm-detect {shlex.quote(options.source)} {given} {pose}{radius}")
    _warn(field_warnings(fit))


def pose(options: argparse.Namespace) -> None:
    """Estimate a pose and write it with the lens; the lens file may be completed in place."""
    if not (options.field and options.output.suffix.lower() == ".toml"):
        _check_lens_path(options.output)
    if (options.balls is not None) + (options.board is not None) + options.field != 1:
        raise InputError(
            "give --balls, or --board with a video or pictures of the board on the floor, or --field with a film of a "
            "field: one of them"
        )
    if options.field:
        _refuse_unused(options, "--field", ("label", "size", "square", "charuco", "marker", "legacy", "thickness"))
        return _pose_from_field(options)
    if options.lens is None:
        raise InputError("no lens; give --lens FILE")
    if options.board is not None:
        _refuse_unused(options, "--board", ("radius", "label", "size"))
    else:
        _refuse_unused(options, "--balls", ("square", "charuco", "marker", "legacy", "thickness"))
    file = read_lens_file(options.lens)
    fit = _pose_from_balls(options, file.lens) if options.board is None else _pose_from_board(options, file.lens)
    _write(options.output, file.lens, fit.orientation, pose_lines(fit))
    _warn(list(fit.warnings))


def _board(options: argparse.Namespace, square: float | None) -> Board:
    """The board of the options; without --square, with the default `square` [m]. Raises InputError."""
    side = options.square if options.square is not None else square
    if side is None:
        raise InputError("the size of the board is missing; give --square in meters")
    if options.charuco is not None and options.square is None:
        raise InputError("a ChArUco board needs --square and --marker, the lengths of their sides [m]")
    return board_from(options.board, side, options.charuco, options.marker, options.legacy)


def _fit(kind: str, sightings: list[Sighting], size: Size) -> LensFit:
    """The fitted lens of a kind; for `auto` the better one of pinhole and fisheye. Raises InputError."""
    count = len(sightings)
    if kind != "auto":
        _tell(f"fitting a lens of kind {kind} to {count} frames")
        return fit_lens(kind, sightings, size)
    fits, problems = [], []
    for each in ("pinhole", "fisheye"):
        _tell(f"fitting a lens of kind {each} to {count} frames")
        try:
            fits.append(fit_lens(each, sightings, size))
        except InputError as error:
            problems.append(error)
    if not fits:
        raise problems[0]
    print("tried           " + ", ".join(f"{fit.kind} {fit.typical_error:.2f} px" for fit in fits))
    return min(fits, key=lambda fit: fit.typical_error)


def _refuse_unused(options: argparse.Namespace, method: str, names: Sequence[str]) -> None:
    """Raise InputError if an option is given that only the other method takes."""
    unused = [f"--{name}" for name in names if getattr(options, name)]
    if unused:
        raise InputError(f"{method} does not use {', '.join(unused)}; leave out one of them")


def _pose_from_balls(options: argparse.Namespace, lens: Lens) -> PoseFit:
    if options.source is not None:
        raise InputError(f"--balls needs no SOURCE; remove {options.source}")
    check_not_input(options.output, ball_files(options.balls))
    size = parse_size(options.size) if options.size is not None else lens.size
    balls, size = read_balls(options.balls, options.radius, options.label, size)
    return fit_balls(balls, lens.for_image(size), size)


def _pose_from_board(options: argparse.Namespace, lens: Lens) -> PoseFit:
    if options.source is None:
        raise InputError("--board needs SOURCE: a video, folder or picture of the board on the floor")
    if not 0.0 <= options.thickness < 1.0:
        raise InputError(f"--thickness must be a length from 0 to 1 m, not {options.thickness:g}")
    check_not_input(options.output, open_source(options.source).files)
    search = find_boards(options.source, _board(options, None))
    sightings = choose(search, _MOST_PLACES)
    return fit_board_on_floor(sightings, lens.for_image(search.size), search.size, options.thickness)


def _pose_from_field(options: argparse.Namespace) -> None:
    """Write a fixed pose as a lens file, or the correction of a stream of poses as a vm.toml."""
    if options.source is None:
        raise InputError("--field needs SOURCE: a recording, video or folder of pictures of a field")
    check_not_input(options.output, open_source(options.source).files)
    _check_lengths(options)
    file = None if options.lens is None else read_lens_file(options.lens)
    views, has_poses = read_views(
        options.source, None if file is None else file.lens, None, None if file is None else file.orientation
    )
    _tell(f"searching {len(views)} frames")
    to_configuration = options.output.suffix.lower() == ".toml"
    if to_configuration and not has_poses:
        raise InputError(f"{options.source} has no poses to correct; give -o a name that ends in .yaml")
    if not to_configuration and not _same_pose(views):
        raise InputError("the poses of the frames differ: give -o a vm.toml, which gets the correction for all poses")
    fit = fit_field(views, has_poses, _NETWORK, options.radius, options.line_width)
    if to_configuration:
        lines = field_lines(fit, fixed=False)
        _write_correction(options, fit, lines)
    else:
        _write(options.output, views[0].lens, fit.orientation, field_lines(fit, fixed=True))
    _warn(field_warnings(fit))


def _same_pose(views: Sequence[View]) -> bool:
    first = views[0].orientation
    return all(
        abs(each.orientation.height - first.height) < 1e-3
        and abs(each.orientation.level - first.level).max() < math.radians(0.05)
        for each in views
    )


def _write_correction(options: argparse.Namespace, fit: FieldFit, lines: list[str]) -> None:
    """Write the vm.toml of a recording with the correction of [pose], and print the report."""
    path = Path(options.source) / CONFIGURATION
    known = read_configuration(path) if path.is_file() else Configuration()
    pitch, roll, height = fit.errors.tolist()
    corrected = replace(
        known.pose,
        add_pitch=round(known.pose.add_pitch + pitch, 5),
        add_roll=round(known.pose.add_roll + roll, 5),
        scale_height=round(known.pose.scale_height * (math.exp(height) if fit.scale else 1.0), 4),
    )
    head = "\n".join(["made by vm-calibrate", *lines, "", HEADER])
    write_file(options.output, to_commented_toml(replace(known, pose=corrected), head).encode())
    print("\n".join(lines))
    print(f"{options.output}: written; its section [pose] has the correction")


def _check_lengths(options: argparse.Namespace) -> None:
    for name, most in (("radius", 1.0), ("line_width", 0.5)):
        given = getattr(options, name)
        if given is not None and not 0.0 < given <= most:
            raise InputError(f"--{name.replace('_', '-')} must be a length above 0 and up to {most:g} m, not {given:g}")


def _pose_options(pose: Orientation) -> str:
    pitch, roll = math.degrees(pose.pitch), math.degrees(pose.roll)
    return f"--height {pose.height:.2f} --pitch={pitch:.1f}deg --roll={roll:.1f}deg"


def _radius_option(options: argparse.Namespace) -> str:
    return "" if options.radius is None else f" --object-radius {options.radius:g}"


def _check_lens_path(path: Path) -> None:
    """Raise InputError for a file that can't be written, or that vm-detect would read as TOML."""
    check_writable(path)
    if path.suffix.lower() == ".toml":
        raise InputError(f"{path} must end in .yaml: the lens file is YAML")


def _write(path: Path, lens: Lens, orientation: Orientation | None, lines: list[str]) -> None:
    """Write a lens file with a report at its head, and print the report."""
    head = "".join(f"# {line}\n" for line in ["made by vm-calibrate", *lines])
    write_file(path, head + format_lens_file(lens, orientation))
    print("\n".join(lines))
    print(f"{path}: written")


def _tell(progress: str) -> None:
    """Say what takes the next seconds, or a minute on a slow machine."""
    print(f"vm-calibrate: {progress}", file=sys.stderr)


def _warn(warnings: list[str]) -> None:
    for warning in warnings:
        print(f"vm-calibrate: warning: {warning}", file=sys.stderr)


COMMANDS: dict[str, Callable[[argparse.Namespace], None]] = {
    "board": board,
    "lens": lens,
    "kalibr": kalibr,
    "pose": pose,
    "photo": photo,
}
