"""Reads the lens of a camera from a file of Kalibr: camchain.yaml."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vm_embedded.arrays import number_or_nan
from vm_embedded.config.yaml_reader import read_yaml
from vm_embedded.errors import InputError, unknown
from vm_embedded.files import read_text
from vm_embedded.geometry.calibrated_lenses import BrownLens, CalibratedLens, FisheyeLens

from .lens_kinds import FLAT_FOV, WIDE_FOV

_LARGEST = 2**20
"""Largest size of a file [bytes]."""

_OTHER_CAMERAS = {"omni": "Mei's omnidirectional model", "eucm": "the enhanced unified model", "ds": "double sphere"}


def read_kalibr(path: Path, camera: str | None) -> tuple[str, CalibratedLens]:
    """The name and lens of a camera of a Kalibr file; without a name, of its only camera.

    Raises InputError with the file and the reason: also for a file of several cameras without a name, and for lens
    models that vm-detect does not have.
    """
    text = read_text(path, largest=_LARGEST)
    try:
        table = read_yaml(text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    cameras = {} if not isinstance(table, Mapping) else {k: v for k, v in table.items() if isinstance(v, Mapping)}
    if isinstance(table, Mapping) and "camera_model" in table:
        cameras = {"cam0": table}  # Kalibr's own input files have one camera without a name
    if not any("camera_model" in each for each in cameras.values()):
        raise InputError(f"{path} has no camera of Kalibr, which is a table with `camera_model` and `intrinsics`")
    if camera is None and len(cameras) > 1:
        raise InputError(
            f"{path} has {len(cameras)} cameras; choose one with --camera ({', '.join(map(str, cameras))})"
        )
    if camera is not None and camera not in cameras:
        raise InputError(f"{path}: {unknown('camera', camera, map(str, cameras))}")
    name = next(iter(cameras)) if camera is None else camera
    try:
        return str(name), _lens(cameras[name])
    except InputError as error:
        raise InputError(f"{path}, {name}: {error}") from error


def _lens(table: Mapping[str, Any]) -> CalibratedLens:
    model, distortion = str(table.get("camera_model")).lower(), str(table.get("distortion_model")).lower()
    if model in _OTHER_CAMERAS:
        raise InputError(
            f"camera model {model} ({_OTHER_CAMERAS[model]}) has no lens in vm-detect; calibrate again with Kalibr's "
            "`pinhole-equi`, or with vm-calibrate lens"
        )
    if model != "pinhole":
        raise InputError(unknown("camera model", model, ("pinhole",)))
    if distortion == "fov":
        raise InputError(
            "distortion model fov has no lens in vm-detect; calibrate again with Kalibr's `pinhole-equi`, or with "
            "vm-calibrate lens"
        )
    coefficients = () if distortion == "none" else tuple(_numbers(table, "distortion_coeffs", 4))
    fx, fy, cx, cy = _numbers(table, "intrinsics", 4)
    width, height = (int(each) for each in _numbers(table, "resolution", 2))
    common: dict[str, Any] = {
        "focal_lengths": (fx, fy),
        "optical_center": (cx, cy),
        "coefficients": coefficients,
        "size": (width, height),
    }
    if distortion in ("equidistant", "equi"):
        return FisheyeLens(fov=WIDE_FOV, **common)
    if distortion in ("radtan", "none"):
        return BrownLens(fov=FLAT_FOV, **common)
    raise InputError(unknown("distortion model", distortion, ("radtan", "equidistant", "none")))


def _numbers(table: Mapping[str, Any], key: str, count: int) -> list[float]:
    values = table.get(key)
    numbers = [number_or_nan(each) for each in values] if isinstance(values, list) else []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(f"{key} must be {count} numbers, not {str(values)[:60]}")
    return numbers
