"""Reads and writes lens files: the reference's lens*.yaml, calibrations of OpenCV and ROS, and TOML."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import number_or_nan, numbers_or_nan
from ..config.toml_reader import parse_toml
from ..config.units import parse_angle
from ..config.yaml_reader import read_yaml
from ..errors import InputError, VisualMeshError, unknown
from ..files import read_text
from .calibrated_lenses import BrownLens, CalibratedLens, FisheyeLens
from .foreign_lens_files import FISHEYE, calibration_model, check_units, foreign_table, foreign_text, is_model_key
from .lens import Lens
from .orientation import Orientation
from .radial_lenses import RadialLens, projection_named

_LARGEST = 2**20
"""Largest size of a lens file [bytes]; a usual one has about a thousand."""

_LENS_KEYS = ("projection", "focal_length", "center", "distortion", "fov", "size")

_REFERENCE_KEYS = ("projection", "focal_length", "centre", "k", "fov", "size", "Hoc")
"""Keys of the reference's lens files, and `size`, which only ours have."""

_REFERENCE_NAMES = {"centre": "center", "k": "distortion"}
"""The reference's names of keys, and ours."""

_COEFFICIENT_KEYS = (
    "distortion_coefficients",
    "D",
    "d",
    "distCoeffs",
    "dist_coeffs",
    "dist_coeff",
    "distortion_coeffs",
)
"""Names that programs give to the distortion coefficients of a calibration."""


@dataclass(frozen=True)
class LensFile:
    """The contents of a lens file.

    lens: the lens. orientation: of the camera, or None if the file has no `Hoc`. path: the file, or None for a lens
    from elsewhere.
    """

    lens: Lens
    orientation: Orientation | None
    path: Path | None = None


def read_lens_file(path: str | Path) -> LensFile:
    """Reads a lens file: TOML if its name ends in .toml, else YAML. Raises InputError with the file and the reason."""
    path = Path(path)
    text = read_text(path, "lens file", _LARGEST)
    try:
        if path.suffix.lower() == ".toml":
            table = _read_text(text, parse_toml)
            return LensFile(lens_from_table(table.get("lens", table)), None, path)
        return replace(parse_lens_yaml(text), path=path)
    except VisualMeshError as error:
        raise InputError(f"lens file {path}: {error}") from error


def parse_lens_yaml(text: str) -> LensFile:
    """Reads the text of a lens file in YAML. Raises InputError, also for a bad orientation GeometryError."""
    table = _read_text(text, read_yaml)
    if not isinstance(table, dict):
        raise InputError("expected a table of keys and values")
    lens = table.get("lens")
    if isinstance(lens, dict) and table.keys() <= {"lens", "Hoc"}:
        table = {**lens, **{key: value for key, value in table.items() if key != "lens"}}
    hoc = table.pop("Hoc", None)
    orientation = None if hoc is None else Orientation.from_hoc(hoc)
    if not {"projection", "focal_length"} & table.keys():
        return LensFile(lens_from_calibration(table), orientation)
    for key in table:
        if key not in (*_REFERENCE_KEYS, *_LENS_KEYS):
            raise InputError(unknown("lens key", key, _REFERENCE_KEYS))
    named = {str(_REFERENCE_NAMES.get(key, key)): value for key, value in table.items()}
    return LensFile(lens_from_table(named), orientation)


def _read_text(text: str, parse: Callable[[str], Any]) -> Any:
    """What a parser makes of a text. Raises InputError, which names the format of a file of another program."""
    foreign = foreign_text(text, parse is parse_toml)
    if foreign:
        raise InputError(foreign)
    return parse(text)


def format_lens_file(lens: Lens, orientation: Orientation | None) -> str:
    """The text of a lens file with this lens and orientation; reading it gives exactly the same numbers.

    Radial lenses use the reference's format, calibrated ones a calibration with an additional Hoc. Without an
    orientation there is no Hoc. Raises InputError for other lenses.
    """
    if isinstance(lens, RadialLens):
        lines = [
            f"projection: {type(lens).__name__.upper()}",
            f"focal_length: {lens.focal_length!r}",
            f"centre: {_listed(lens.center)}",
            f"k: {_listed(lens.distortion)}",
            f"fov: {lens.fov!r}",
        ]
        if lens.size is not None:
            lines.append(f"size: {_listed(lens.size)}")
    elif isinstance(lens, CalibratedLens):
        (fx, fy), (cx, cy) = lens.focal_lengths, lens.optical_center
        brown = "plumb_bob" if len(lens.coefficients) <= 5 else "rational_polynomial"
        lines = [
            f"distortion_model: {'equidistant' if isinstance(lens, FisheyeLens) else brown}",
            f"camera_matrix: {_listed((fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0))}",
            f"distortion_coefficients: {_listed(lens.coefficients)}",
        ]
        if lens.size is not None:
            lines += [f"image_width: {lens.size[0]}", f"image_height: {lens.size[1]}"]
    else:
        raise InputError(f"lens of type {type(lens).__name__} has no file format; use a radial or a calibrated lens")
    if orientation is not None:
        hoc = np.eye(4)
        hoc[:3, :3] = orientation.rotation
        hoc[2, 3] = orientation.height
        lines += ["Hoc:", *(f"  - {_listed(row)}" for row in hoc.tolist())]
    return "\n".join(lines) + "\n"


def _listed(numbers: Sequence[float]) -> str:
    return f"[{', '.join(repr(each) for each in numbers)}]"


def lens_from_table(table: Mapping[str, Any]) -> RadialLens:
    """A lens from the keys projection, focal_length [px] and fov [rad, or as in "174deg"], and optionally center,
    distortion and size [px].

    Raises InputError for an unknown or missing key and for a wrong value.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"lens must be a table, not {str(table)[:60]}")
    check_units(table)
    for key in table:
        if key not in _LENS_KEYS:
            raise InputError(unknown("lens key", key, _LENS_KEYS))
    missing = [key for key in ("projection", "focal_length", "fov") if key not in table]
    if missing:
        raise InputError(f"lens needs {', '.join(missing)}")
    size: Any = _numbers(table["size"], "size", 2) if "size" in table else None
    return projection_named(table["projection"])(
        focal_length=_number(table["focal_length"], "focal_length"),
        fov=parse_angle(table["fov"], "fov"),
        center=table.get("center", (0.0, 0.0)),
        distortion=table.get("distortion", (0.0, 0.0)),
        size=size,
    )


def lens_from_calibration(table: Mapping[str, Any]) -> Lens:
    """A lens from a calibration as ROS (camera_info) or OpenCV (camera_matrix, ...) writes it. Raises InputError."""
    matrix = _first(table, "camera_matrix", "K", "k", "cameraMatrix")
    if matrix is None:
        raise InputError(
            foreign_table(table) or "found neither `projection`, as in a lens, nor `camera_matrix`, as in a calibration"
        )
    k = _numbers(_data(matrix), "camera_matrix", 9)
    coefficients = _numbers(_data(_coefficients(table)), "distortion")
    width, height = (_first(table, f"image_{side}", side) for side in ("width", "height"))
    model = calibration_model(table)
    common: dict[str, Any] = {
        "focal_lengths": (k[0], k[4]),
        "optical_center": (k[2], k[5]),
        "size": None if width is None or height is None else (_number(width, "width"), _number(height, "height")),
    }
    if abs(k[1]) > 1e-6 * abs(k[0]):
        raise InputError(f"camera_matrix has a skew of {k[1]:g}, but only calibrations without skew are supported")
    if model == FISHEYE:
        return FisheyeLens(fov=2.0 * math.pi, coefficients=tuple(coefficients), **common)
    while len(coefficients) > 8 and coefficients[-1] == 0.0:
        coefficients.pop()  # OpenCV writes 12 or 14 coefficients even if the last ones are zero
    # Calibrations have no field of view. 160 degrees is as wide as a rectilinear picture gets.
    return BrownLens(fov=math.radians(160.0), coefficients=tuple(coefficients), **common)


def _coefficients(table: Mapping[str, Any]) -> Any:
    """The distortion coefficients of a calibration; an empty list if it has none.

    Raises InputError for a key that may be meant for them, since a lens without its distortion is silently wrong.
    """
    for key, value in table.items():
        if "dist" in str(key).lower() and key not in _COEFFICIENT_KEYS and not is_model_key(key, value):
            raise InputError(unknown("key", key, (*_COEFFICIENT_KEYS, "distortion_model")))
    return _first(table, *_COEFFICIENT_KEYS) or []


def _first(table: Mapping[str, Any], *keys: str) -> Any:
    """The value of the first of these keys that the table has, or None."""
    return next((table[key] for key in keys if key in table), None)


def _data(value: Any) -> Any:
    """The numbers of a matrix given as a table of rows, cols and data; any other value unchanged."""
    return value.get("data", value) if isinstance(value, Mapping) else value


def _number(value: Any, name: str) -> float:
    number = number_or_nan(value)
    if not math.isfinite(number):
        raise InputError(f"{name} must be a number, not {repr(value)[:60]}")
    return number


def _numbers(value: Any, name: str, count: int | None = None) -> list[float]:
    """A flat list of `count` numbers from a list, or from a list of lists."""
    numbers = numbers_or_nan(value).ravel()
    if not np.isfinite(numbers).all() or (count is not None and len(numbers) != count):
        raise InputError(f"{name} must be {count or 'finite'} numbers, not {str(value)[:60]}")
    return numbers.tolist()
