"""Which lens model a calibration has: programs name it under many keys, and in many ways."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..errors import InputError, unknown

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
