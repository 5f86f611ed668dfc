"""Parsing of pose lines: JSON objects with which a robot sends the pose of its camera.

{"t": 12.345, "height": 0.8, "quaternion": [w, x, y, z]}    rotation from the camera to the observation plane
{"t": 12.345, "Hoc": [[...], [...], [...], [0, 0, 0, 1]]}   the same as a matrix, with the height in row 2, column 3

t is in seconds, lengths are in meters. The parser does not trust the robot: it checks every number and rotation.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import number_or_nan
from ..errors import InputError, VisualMeshError, unknown
from ..geometry.orientation import OPTICAL_TO_CAMERA, Orientation

MAX_LINE_BYTES = 4096
"""A longer line is rejected [bytes]."""

_KEYS = ("t", "height", "quaternion", "Hoc")


@dataclass(frozen=True)
class PoseLine:
    """time: t [s], None if the line has none. orientation: of the camera."""

    time: float | None
    orientation: Orientation


def parse_pose_line(line: bytes, optical: bool = False) -> PoseLine:
    """Parse a line. optical: the rotation is that of an optical frame (z forward, x right). Raises InputError."""
    if len(line) > MAX_LINE_BYTES:
        raise InputError(f"pose line has {len(line)} bytes, more than {MAX_LINE_BYTES}")
    try:
        data = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise InputError(f"pose is not valid JSON: {_shown(line)}") from error
    if not isinstance(data, dict):
        raise InputError(f'pose must be like {{"t": 1.0, "height": 0.8, "quaternion": [1, 0, 0, 0]}}: {_shown(line)}')
    for key in data:
        if key not in _KEYS:
            raise InputError(unknown("key in a pose", key[:40], _KEYS))
    try:
        return PoseLine(None if data.get("t") is None else _number(data["t"], "t"), _orientation(data, optical))
    except VisualMeshError as error:
        raise InputError(f"pose: {error}") from error


def _orientation(data: dict[str, Any], optical: bool) -> Orientation:
    if "Hoc" in data:
        if "quaternion" in data or "height" in data:
            raise InputError("give either Hoc, or height and quaternion, not both")
        hoc = np.array([_numbers(row, "a row of Hoc", 4) for row in _list(data["Hoc"], "Hoc", 4)])
        if optical:
            hoc[:3, :3] = hoc[:3, :3] @ OPTICAL_TO_CAMERA.T
        return Orientation.from_hoc(hoc)
    missing = [name for name in ("height", "quaternion") if name not in data]
    if missing:
        raise InputError(f"lacks {' and '.join(missing)}")
    height = _number(data["height"], "height")
    return Orientation.from_quaternion(height, _numbers(data["quaternion"], "quaternion", 4), optical)


def _number(value: Any, name: str) -> float:
    number = number_or_nan(value)
    if not abs(number) <= 1e15:
        raise InputError(f"{name} must be a finite number, not {str(value)[:40]}")
    return number


def _list(value: Any, name: str, count: int) -> list[Any]:
    if not isinstance(value, list) or len(value) != count:
        raise InputError(f"{name} must be a list of {count} values, not {str(value)[:40]}")
    return value


def _numbers(value: Any, name: str, count: int) -> list[float]:
    return [_number(each, name) for each in _list(value, name, count)]


def _shown(line: bytes) -> str:
    return repr(line[:60])[1:]
