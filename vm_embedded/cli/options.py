"""Options that the commands share: model, lens, orientation and settings, from the command line and from vm.toml."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from ..cameras.camera import CameraSettings
from ..detection.settings import Settings
from ..geometry.lens_files import read_lens_file
from ..live.configuration import Configuration, FixedPose, StatusSettings, read_configuration, with_overrides
from ..network.bundled import DEFAULT, SHIPPED
from ..output.channels import OutputSettings
from ..output.recorder import CONFIGURATION, MESSAGES, RecorderSettings
from ..poses.settings import PoseSettings

LIVE = {
    "camera": CameraSettings,
    "pose": PoseSettings,
    "output": OutputSettings,
    "status": StatusSettings,
    "recorder": RecorderSettings,
}
"""Sections that are for live cameras."""

ANGLES = (
    "Angles are radians, or degrees with a suffix as in 20deg; negative ones in degrees need an equals sign, "
    "--pitch=-20deg."
)


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
    add_section(parser.add_argument_group("settings"), Settings, "")


def add_live(parser: argparse.ArgumentParser) -> None:
    """An option for each entry of the sections that are for live cameras."""
    for name, section in LIVE.items():
        group = parser.add_argument_group(f"[{name}], for live cameras")
        add_section(group, section, f"{name}_", ("source",) if name == "camera" else ())


def add_section(group: argparse._ArgumentGroup, section: Any, prefix: str, but: Sequence[str] = ()) -> None:
    """An option for each entry of a section, `but` some; their names begin with `prefix`."""
    for each in fields(section):
        if each.name in but:
            continue
        unit = each.metadata["unit"]
        default = "the model's" if each.default is None else "none" if each.default == "" else each.default
        help = f"{each.metadata['help']}{f' [{unit}]' if unit else ''}; default {default}".replace("%", "%%")
        option = "--" + (prefix + each.name).replace("_", "-")
        if "allowed" in each.metadata:
            group.add_argument(option, choices=each.metadata["allowed"], help=help)
        elif isinstance(each.default, bool):
            group.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=help)
        else:
            kind = str if isinstance(each.default, str) else int if isinstance(each.default, int) else float
            group.add_argument(option, type=kind, metavar={str: "TEXT", int: "N", float: "X"}[kind], help=help)


def read_options(options: argparse.Namespace) -> Configuration:
    """What the command line and the configuration say together. Raises InputError."""
    config = options.config or _recorded(getattr(options, "camera", None))
    configured = read_configuration(config) if config else Configuration()
    sections = {"orientation": (FixedPose, ""), "detector": (Settings, "")}
    sections |= {name: (section, f"{name}_") for name, section in LIVE.items()}
    given = {name: _given(options, section, prefix) for name, (section, prefix) in sections.items()}
    if getattr(options, "camera", None) is not None:
        given["camera"]["source"] = options.camera
    configured = with_overrides(configured, given)
    if options.model is not None:
        configured = replace(configured, model=options.model)
    if options.lens is not None:
        configured = replace(configured, lens=read_lens_file(options.lens))
    return configured


def _recorded(source: str | None) -> Path | None:
    """The vm.toml of a recording, if the source is one."""
    folder = Path(source or "")
    recorded = source is not None and (folder / MESSAGES).is_file() and (folder / CONFIGURATION).is_file()
    return folder / CONFIGURATION if recorded else None


def _given(options: argparse.Namespace, section: Any, prefix: str) -> dict[str, Any]:
    """The entries of a section that the command line gives."""
    given = {each.name: getattr(options, prefix + each.name, None) for each in fields(section)}
    return {name: value for name, value in given.items() if value is not None}
