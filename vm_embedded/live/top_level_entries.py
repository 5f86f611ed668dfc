"""The entries of vm.toml above all sections, model, lens and fov: reading them, and writing them with a comment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from ..config.toml_writer import toml_value
from ..config.units import parse_angle
from ..errors import InputError
from ..geometry.lens_files import LensFile, lens_from_table
from ..geometry.radial_lenses import RadialLens
from ..network.bundled import SHIPPED


def read_model_entry(value: object) -> str:
    """A path of a model file, or a name of the package. Raises InputError for other types."""
    if not isinstance(value, str):
        raise InputError(f"model must be a path, not {value!r}")
    return value


def commented_model(value: str) -> str:
    """The entry as TOML, with a comment."""
    comment = f"# the network: a file written by vm-export, or one that comes with the package: {', '.join(SHIPPED)}"
    return f"{comment}\nmodel = {toml_value(value)}"


def read_lens_entry(value: object) -> Path | LensFile:
    """The path of a lens file, or the lens of a table [lens]. Raises InputError."""
    if isinstance(value, str):
        return Path(value)
    if not isinstance(value, Mapping):
        raise InputError(f"lens must be a path or a table, [lens], not {value!r}")
    return LensFile(lens_from_table(value), None)


def checked_fov(value: object) -> float:
    """A horizontal angle of view [rad] from a number or text in radians, or from text in degrees. Raises InputError."""
    fov = parse_angle(value, "fov")
    if not math.radians(1.0) <= fov <= math.radians(150.0):
        raise InputError(
            f"fov must be from 1deg to 150deg, not {math.degrees(fov):g}deg: it describes a lens without distortion; "
            "for a wider lens, give a lens file"
        )
    return fov


def commented_fov(value: float | None) -> str:
    """The entry as TOML, with a comment."""
    comment = (
        '# instead of a lens: the horizontal angle of view, in radians or as in "70deg", of a lens without distortion'
    )
    return comment + ("\n# fov =" if value is None else f"\nfov = {value!r}")


def commented_lens(value: LensFile | None) -> str:
    """The entry as TOML, with a comment: the absolute path of the lens file, or the numbers of the lens."""
    comment = (
        "# the lens: a calibration file of the Visual Mesh reference, OpenCV or ROS, or a TOML file; or a table,\n"
        '# [lens], with projection, focal_length [px] and fov [rad, or as in "174deg"], and optionally center,\n'
        "# distortion and size [px]\n"
    )
    if value is not None and value.path is not None:  # absolute, because the new file may be in another folder
        return comment + f"lens = {toml_value(str(value.path.absolute()))}"
    lens = value.lens if value is not None else None
    if not isinstance(lens, RadialLens):
        return comment + '# lens = "lens.yaml"'
    size = "" if lens.size is None else f", size = {list(lens.size)}"
    return comment + (
        f'lens = {{ projection = "{type(lens).__name__.lower()}", focal_length = {lens.focal_length!r}, '
        f"fov = {lens.fov!r}, center = {list(lens.center)}, distortion = {list(lens.distortion)}{size} }}"
    )
