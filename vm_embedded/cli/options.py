"""Options that the commands share, and the configuration that they and vm.toml give together."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import Field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..cameras.camera import CameraSettings
from ..cameras.image_files import MESSAGES
from ..cameras.open_camera import is_live
from ..cameras.ros.settings import RosSettings
from ..config.entries import EntryError, checked
from ..detection.settings import Settings
from ..errors import InputError
from ..files import is_file
from ..geometry.lens_files import read_lens_file
from ..live.configuration import (
    Configuration,
    FixedPose,
    StatusSettings,
    TrackSection,
    read_configuration,
    with_overrides,
)
from ..live.top_level_entries import checked_fov
from ..network.bundled import DEFAULT, SHIPPED
from ..output.channels import OutputSettings
from ..output.recorder import CONFIGURATION, RecorderSettings
from ..poses.settings import PoseSettings
from .program import Parser

LIVE = {
    "camera": CameraSettings,
    "pose": PoseSettings,
    "output": OutputSettings,
    "status": StatusSettings,
    "recorder": RecorderSettings,
    "ros": RosSettings,
}
"""Sections for live cameras."""

_USUAL = (
    *("threads", "object_radius", "max_distance", "min_confidence", "track_on", "pose_source"),
    *("output_udp", "output_unix", "status_page", "recorder_folder", "ros_image"),
)
"""Entries whose options --help shows; --help-all shows the others."""

_FILE_ONLY = (
    *("spinning", "pitch_step", "roll_step", "cache_mib", "max_around", "max_widths", "min_visible"),
    *("track_center_error", "track_pixel_error", "track_pose_error", "track_height_error"),
    *("track_wander", "track_max_speed", "track_gate", "track_forget"),
    *("camera_exposure_ms", "camera_gain", "camera_latency_ms", "camera_frozen"),
    *("pose_latency_ms", "pose_extrapolate_ms", "pose_max_age_ms", "pose_max_climb", "pose_max_turn"),
    *("pose_add_pitch", "pose_add_roll", "pose_scale_height", "pose_correct"),
    *("recorder_memory_mib", "recorder_pause", "status_budget_ms"),
)
"""Entries without an option: a robot sets them once, in its vm.toml."""

ANGLES = "Angles are in radians, or in degrees with a suffix as in 20deg."


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the options --model and --config."""
    parser.add_argument(
        "--model",
        metavar="MODEL",
        help=f"model file from vm-export (.onnx), or one from the package: {', '.join(SHIPPED[:-1])} or {SHIPPED[-1]}; "
        f"default {DEFAULT}",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="configuration, vm.toml; options override it")


def add_pose(parser: argparse.ArgumentParser, description: str) -> None:
    """Add the options for lens and orientation. description: shown in the help."""
    pose = parser.add_argument_group("lens and orientation", description)
    pose.add_argument(
        "--lens",
        type=Path,
        metavar="FILE",
        help="lens file: YAML of the reference or of a calibration, or TOML; its Hoc gives the orientation unless "
        "--height does",
    )
    pose.add_argument(
        "--fov",
        metavar="ANGLE",
        help="instead of a lens file: the horizontal angle of view, such as 70deg, of a lens without distortion",
    )
    entries = {each.name: partial(_read, each) for each in fields(FixedPose)}
    pose.add_argument(
        "--height",
        type=entries["height"],
        metavar="M",
        help="height of the camera above the ground plane [m]; default: the pose of the lens file",
    )
    for name, meaning in (
        ("pitch", "angle of the optical axis below the horizon"),
        ("roll", "tilt of the camera to its right side"),
    ):
        pose.add_argument(f"--{name}", type=entries[name], metavar="ANGLE", help=f"{meaning} [rad]; default 0")


def add_settings(parser: Parser, skip: Sequence[str] = ()) -> None:
    """Add the options of Settings, except those in `skip`."""
    _add_section(parser, "settings", Settings, "", skip)


def add_live(parser: Parser) -> None:
    """Add the options of the sections for live cameras."""
    for name, section in LIVE.items():
        title = f"[{name}], for {'vm-ros and bags' if name == 'ros' else 'live cameras'}"
        _add_section(parser, title, section, f"{name}_", ("source",) if name == "camera" else ())


def add_track(parser: Parser) -> None:
    """Add the option --track."""
    _add_section(parser, "[track]", TrackSection, "track_")


def _add_section(parser: Parser, title: str, section: Any, prefix: str, skip: Sequence[str] = ()) -> None:
    """Add options for a section's entries, except those in `skip`. prefix: first part of the option names."""
    group = parser.add_argument_group(title)
    for each in fields(section):
        if each.name in skip or prefix + each.name in _FILE_ONLY:
            continue
        unit = f" [{each.metadata['unit']}]" if each.metadata["unit"] else ""
        help = f"{each.metadata['help']}{unit}{_default(each)}".replace("%", "%%")
        name = prefix + each.name
        option = "--" + name.removesuffix("_on").replace("_", "-")
        if isinstance(each.default, bool):
            added: argparse.Action = group.add_argument(
                option, dest=name, action=argparse.BooleanOptionalAction, default=None, help=help
            )
        else:
            allowed = each.metadata.get("allowed")
            kind = "TEXT" if isinstance(each.default, str) else "N" if isinstance(each.default, int) else "X"
            added = group.add_argument(
                option,
                dest=name,
                type=partial(_read, each),
                choices=allowed,
                metavar=None if allowed else kind,
                help=help,
            )
        if name not in _USUAL:
            parser.hide(added)


def _read(entry: Field[Any], text: str) -> Any:
    """The value of an entry from the text of its option. Raises ArgumentTypeError with the entry's own message."""
    try:
        return checked(entry, text if isinstance(entry.default, str) else _number(text))
    except EntryError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _number(text: str) -> int | float | str:
    """A text as a number; as it is, if it is none: the entry says what it allows, for example an angle in degrees."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _default(entry: Field[Any]) -> str:
    """A default as the help shows it. None: the model decides. Some help texts already say what an empty text means."""
    value = entry.default
    if value == "":
        return "" if "empty" in entry.metadata["help"] else "; default none"
    if value is None:
        return "; default the model's"
    if isinstance(value, bool):
        return "; default on" if value else "; default off"
    return f"; default {value}"


def read_options(options: argparse.Namespace) -> Configuration:
    """The configuration from vm.toml, with the options of the command line on top. Raises InputError."""
    alone = len(getattr(options, "files", ())) <= 1
    config = options.config or _recording_configuration(getattr(options, "camera", None) if alone else None)
    configured = read_configuration(config) if config else Configuration()
    sections = {"orientation": (FixedPose, ""), "detector": (Settings, ""), "track": (TrackSection, "track_")}
    sections |= {name: (section, f"{name}_") for name, section in LIVE.items()}
    given = {name: _given_entries(options, section, prefix) for name, (section, prefix) in sections.items()}
    if getattr(options, "camera", None) is not None:
        given["camera"]["source"] = options.camera
    configured = with_overrides(configured, given)
    if options.model is not None:
        configured = replace(configured, model=options.model)
    if options.lens is not None and options.fov is not None:
        raise InputError("give --lens or --fov, not both")
    if options.lens is not None:
        configured = replace(configured, lens=read_lens_file(options.lens), fov=None)
    if options.fov is not None:
        configured = replace(configured, fov=checked_fov(options.fov), lens=None)
    return configured


def _recording_configuration(source: str | None) -> Path | None:
    """The vm.toml of a recording, if the camera source is one."""
    if source is None or is_live(source):
        return None
    folder = Path(source)
    is_recording = is_file(folder / MESSAGES) and is_file(folder / CONFIGURATION)
    return folder / CONFIGURATION if is_recording else None


def _given_entries(options: argparse.Namespace, section: Any, prefix: str) -> dict[str, Any]:
    """The entries of a section that the command line sets."""
    given = {each.name: getattr(options, prefix + each.name, None) for each in fields(section)}
    return {name: value for name, value in given.items() if value is not None}
