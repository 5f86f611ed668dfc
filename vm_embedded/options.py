"""Options that the commands share: model, lens, orientation and settings, from the command line and from vm.toml."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields
from pathlib import Path

from .configuration import Configuration, angle, length, read_configuration
from .errors import InputError
from .lens import Lens
from .lens_file import read_lens_file
from .orientation import Orientation
from .settings import Settings
from .shipped import DEFAULT, SHIPPED, model_path

ANGLES = (
    "Angles are radians, or degrees with a suffix as in 20deg; negative ones in degrees need an equals sign, "
    "--pitch=-20deg."
)


@dataclass(frozen=True)
class Given:
    """What the user gave; None where nothing was said.

    lens_orientation: what the file of --lens says, from a frame of its own.
    """

    model: Path
    lens: Lens | None
    orientation: Orientation | None
    settings: Settings
    lens_orientation: Orientation | None = None


def add_model(parser: argparse.ArgumentParser) -> None:
    """The options --model and --config."""
    parser.add_argument(
        "--model",
        metavar="MODEL",
        help=f"network that vm-export wrote (.onnx), or {', '.join(SHIPPED[:-1])} or {SHIPPED[-1]}, which come with "
        f"the package; default {DEFAULT}",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="vm.toml; options on the command line override it")


def add_pose(parser: argparse.ArgumentParser, when: str) -> None:
    """The options of lens and orientation, and `when` they count."""
    pose = parser.add_argument_group("lens and orientation", when)
    pose.add_argument("--lens", type=Path, metavar="FILE", help="lens file: reference or calibration YAML, or TOML")
    pose.add_argument("--height", metavar="M", help="height of the camera over the plane [m]")
    pose.add_argument("--pitch", metavar="ANGLE", help="angle of the optical axis below the horizon; default 0")
    pose.add_argument("--roll", metavar="ANGLE", help="lean of the camera to the right; default 0")


def add_settings(parser: argparse.ArgumentParser) -> None:
    """An option for each field of Settings."""
    settings = parser.add_argument_group("settings")
    for each in fields(Settings):
        unit, limits = each.metadata["unit"], each.metadata.get("range")
        default = "the model's" if each.default is None else each.default
        help = f"{each.metadata['help']}{f' [{unit}]' if unit else ''}; default {default}"
        option = "--" + each.name.replace("_", "-")
        if "allowed" in each.metadata:
            settings.add_argument(option, choices=each.metadata["allowed"], help=help)
        elif limits is None:
            settings.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=help)
        else:
            kind = int if isinstance(each.default, int) else float
            settings.add_argument(option, type=kind, metavar="N" if kind is int else "X", help=help)


def read_options(options: argparse.Namespace) -> Given:
    """What the command line and the configuration say together. Raises InputError."""
    configured = read_configuration(options.config) if options.config else Configuration()
    model = configured.model if options.model is None else model_path(options.model)
    given = {each.name: getattr(options, each.name) for each in fields(Settings)}
    settings = {**configured.settings, **{name: value for name, value in given.items() if value is not None}}
    file = read_lens_file(options.lens) if options.lens else None
    return Given(
        model or model_path(DEFAULT),
        file.lens if file else configured.lens,
        _orientation(options, configured),
        Settings(**settings),
        file.orientation if file else None,
    )


def _orientation(options: argparse.Namespace, configured: Configuration) -> Orientation | None:
    """The orientation of the command line and the configuration, or None without a height."""
    height = length(options.height) if options.height is not None else configured.height
    pitch = angle(options.pitch) if options.pitch is not None else configured.pitch
    roll = angle(options.roll) if options.roll is not None else configured.roll
    if height is None:
        if pitch is not None or roll is not None:
            raise InputError("pitch and roll need a height: give --height")
        return None
    return Orientation.from_roll_pitch(height, roll or 0.0, pitch or 0.0)
