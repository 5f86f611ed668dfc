"""Lens files in formats of other programs: what they are, and what to do with them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..config.toml_reader import parse_toml
from ..errors import InputError, unknown

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


BROWN, FISHEYE = "brown", "fisheye"
"""The models: rectilinear with Brown-Conrady distortion, and Kannala-Brandt."""

_NAMES = {
    BROWN: (
        "plumb_bob",
        "rational_polynomial",
        "radtan",
        "brown_conrady",
        "brown",
        "radial_tangential",
        "rational",
        "opencv",
        "full_opencv",
        "none",
    ),
    FISHEYE: ("equidistant", "fisheye", "equi", "opencv_fisheye", "kannala_brandt", "kannala_brandt4", "kb4"),
    "": ("pinhole", "perspective"),
}
"""Names of each model in ROS, Kalibr, RealSense, COLMAP and others. The last ones say nothing about distortion."""

_MODELS = {re.sub(r"[^a-z0-9]", "", name): model for model, names in _NAMES.items() for name in names}
_MODELS |= {"kannalabrandt8": FISHEYE, "kb8": FISHEYE, "kb": FISHEYE}

_OTHERS = ("omni", "mei", "ucm", "eucm", "ds", "double_sphere", "fov", "ftheta", "scaramuzza", "ocam", "stereographic")
"""Models without a lens here. With one of them, the other entries don't matter."""

_KEY = re.compile(r"(?:is|use)?fisheye|.*model.*|.*fisheye.*|(?:camera|lens|distortion|projection|dist)?(?:type|kind)")
_NAMED_KEYS = ("lens", "distortion", "projection")
"""Keys that name a model: those of the first form, and these if their value is text."""

_PARAMETER = re.compile(r"[kp]_?[1-6]|xi|alpha|beta")
"""Keys of a single parameter of a lens."""


def is_model_key(key: object, value: object) -> bool:
    """Whether an entry of a calibration names its model, or says whether it is a fisheye."""
    name = re.sub(r"[^a-z]", "", str(key).lower())
    return not isinstance(value, list | dict) and (
        _KEY.fullmatch(name) is not None or (name in _NAMED_KEYS and isinstance(value, str))
    )


def calibration_model(table: Mapping[str, Any]) -> str:
    """The model that the entries of a calibration name: BROWN or FISHEYE; BROWN if none does.

    Raises InputError for an unknown model, for entries that contradict each other, and for single parameters of a lens,
    which would be ignored.
    """
    for key in table:
        if _PARAMETER.fullmatch(str(key).lower()):
            raise InputError(f"the parameter {key!r} is not supported; write all of them as distortion_coefficients")
    named = [(str(key), value) for key, value in table.items() if value not in (None, "") and is_model_key(key, value)]
    read = [(key, value, _model(key, value)) for key, value in named]
    found = {model: (key, value) for key, value, model in reversed(read) if model}
    for key, value, model in read:
        name = str(value).lower()
        is_other = _plain(name) in map(_plain, _OTHERS)
        if model is None and (is_other or not found or "dist" in key.lower()):
            raise InputError(unknown(key, value, (each for names in _NAMES.values() for each in names)))
    if len(found) > 1:
        (first, one), (second, other) = found[FISHEYE], found[BROWN]
        raise InputError(f"{first} {_shown(one)} contradicts {second} {_shown(other)}: remove the wrong one")
    return next(iter(found), BROWN)


def _model(key: str, value: object) -> str | None:
    """The model that an entry names, "" if it says nothing about distortion; None for an unknown one."""
    if "fisheye" in key.lower() and not isinstance(value, str):
        if value not in (0, 1):
            raise InputError(f"{key} must be 0 or 1, not {str(value)[:60]!r}")
        return FISHEYE if value else BROWN
    return _MODELS.get(_plain(str(value)))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _shown(value: object) -> str:
    return str(int(value)) if isinstance(value, bool | int) else repr(value)
