"""Lens files in formats of other programs: what they are, and what to do with them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..config.toml_reader import parse_toml
from ..errors import InputError

_SECTION = re.compile(r"\[[^\[\],]+\]")

_ENTRIES = ("camera_matrix", "K", "cameraMatrix", "projection")
"""Keys of lenses and calibrations."""


def foreign_text(text: str, is_toml: bool) -> str:
    """Why a text is no lens file: it is of another format than its name says. Empty if it may be one."""
    lines = [each.strip() for each in text.splitlines()]
    first = next((each for each in lines if each and each[0] not in "#;%"), "")
    if first.startswith("<"):
        return (
            "it is XML, but lens files are YAML or TOML; OpenCV's FileStorage writes YAML if the name ends in .yaml, "
            "and vm-calibrate lens calibrates again"
        )
    if not _SECTION.fullmatch(first):
        return ""
    try:
        parse_toml(text)
    except InputError:
        return (
            "it is an INI file, but lens files are YAML or TOML; ROS's camera_calibration also writes ost.yaml, and "
            "camera_calibration_parsers converts: ros2 run camera_calibration_parsers convert FILE.ini FILE.yaml"
        )
    return "" if is_toml else "it is TOML: its name must end in .toml"


def foreign_table(table: Mapping[str, Any]) -> str:
    """Which other program's format a table has, and what to do; empty for an unknown one. Raises as `check_units`."""
    inner = {str(key): each for key, each in table.items() if isinstance(each, Mapping)}
    if any("intrinsics" in each for each in (table, *inner.values())):
        return "it is a file of Kalibr: vm-calibrate kalibr FILE -o lens.yaml converts it"
    if any(re.match(r"Camera\d?\.", str(key)) for key in table):
        return (
            "it holds settings of ORB-SLAM: write Camera.fx and so on as camera_matrix and distortion_coefficients, "
            "and Camera.type as distortion_model"
        )
    if "projection_parameters" in table:
        return "it is a file of camodocal: write mu, mv, u0, v0 (fx, fy, cx, cy) as camera_matrix"
    check_units(inner.get("lens", {}))
    nested = next((key for key, each in inner.items() if any(name in each for name in _ENTRIES)), None)
    if nested is not None:
        return f"its lens is in the table {nested!r}: move these entries to the top level"
    return ""


def check_units(table: Mapping[str, Any]) -> None:
    """Raise InputError for a lens of NUbots, whose numbers are in widths of the image."""
    if str(table.get("fov")).lower() == "auto":
        raise InputError(
            "`fov: auto` is of a camera configuration of NUbots, with lengths in widths of the image: write fov as an "
            "angle, multiply focal_length and centre by the width [px], divide k by its 2nd and 4th power"
        )
