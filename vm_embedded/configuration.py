"""vm.toml and what else says how a detector is to be run, checked at the border.

model = "ball.onnx"             # paths count from the file's own folder; or a network of the package, "ball-9x4"
lens = "lens.yaml"              # or a table: [lens] projection = ..., see lens_file.py
[orientation]
height = 0.8                    # [m]
pitch = "20deg"                 # [rad] if a bare number
roll = 0.0
[detector]
threads = 1                     # every field of Settings
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from .errors import InputError, VisualMeshError, unknown
from .lens import Lens
from .lens_file import lens_from_table, read_lens_file
from .settings import Settings, check_setting
from .shipped import model_path

_KEYS = ("model", "lens", "orientation", "detector")
_ANGLES = ("height", "pitch", "roll")
_DEGREES = re.compile(r"\s*([-+0-9.eE]+)\s*deg\s*")


@dataclass(frozen=True)
class Configuration:
    """What was configured; None and missing settings are left to whoever asks.

    height [m], pitch and roll [rad] of the camera, where no frame brings its own.
    """

    model: Path | None = None
    lens: Lens | None = None
    height: float | None = None
    pitch: float | None = None
    roll: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


def read_configuration(path: str | Path) -> Configuration:
    """Read a vm.toml. Raises InputError naming the file, an unknown key with the nearest known one, or a bad value."""
    path = Path(path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"can't read configuration {path}: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"configuration {path}: {error}") from error
    try:
        return _configuration(table, path.parent)
    except VisualMeshError as error:
        raise InputError(f"configuration {path}: {error}") from error


def _configuration(table: Mapping[str, Any], folder: Path) -> Configuration:
    _only(table, _KEYS, "key")
    orientation = _table(table, "orientation")
    settings = _table(table, "detector")
    known = {each.name: each for each in fields(Settings)}
    _only(orientation, _ANGLES, "key in [orientation]")
    _only(settings, known, "key in [detector]")
    for name, value in settings.items():
        check_setting(known[name], value)
    model = table.get("model")
    if model is not None and not isinstance(model, str):
        raise InputError(f"model must be a path, not {model!r}")
    lens = table.get("lens")
    if isinstance(lens, str):
        lens = read_lens_file(folder / lens).lens
    elif lens is not None:
        lens = lens_from_table(_table(table, "lens"))
    return Configuration(
        model=None if model is None else folder / model_path(model),
        lens=lens,
        height=length(orientation["height"]) if "height" in orientation else None,
        pitch=angle(orientation["pitch"]) if "pitch" in orientation else None,
        roll=angle(orientation["roll"]) if "roll" in orientation else None,
        settings=settings,
    )


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise InputError(f"{key} must be a table, [{key}], not {value!r}")
    return value


def _only(table: Mapping[str, Any], allowed: Any, what: str) -> None:
    for key in table:
        if key not in allowed:
            raise InputError(unknown(what, key, allowed))


def length(value: object) -> float:
    """A finite number of metres, from a number or its text. Raises InputError."""
    return _finite(value, f"{value!r} is not a number of metres")


def angle(value: object) -> float:
    """An angle [rad] from a number or text in radians, or from text in degrees such as "20deg". Raises InputError."""
    what = f"{value!r} is not an angle; write radians, or degrees as in 20deg"
    degrees = _DEGREES.fullmatch(value) if isinstance(value, str) else None
    if degrees:
        return math.radians(_finite(degrees.group(1), what))
    number = _finite(value, what)
    if abs(number) > 2.0 * math.pi:
        raise InputError(f"{number:g} rad is more than a turn; did you mean {number:g}deg?")
    return number


def _finite(value: object, what: str) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(what)
    return number
