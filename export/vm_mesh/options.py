"""From the options of vm-mesh to a mesh plan, a lens, a camera pose and distances."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.config.units import parse_angle, parse_length, parse_size
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import LensFile, read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shapes import Cylinder, make_shape
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_embedded.network.model_file import read_model

from .built_mesh import MeshPlan

_ENTRIES = ("shape", "radius", "object_height", "intersections", "max_distance")
"""Entries of a mesh that a network has."""


def plan_and_model(options: argparse.Namespace, file: LensFile | None) -> tuple[MeshPlan, str]:
    """The plan of the mesh, and the model of --network, or of the network that vm-detect uses without --model.

    An option comes before the entry of the network. The height comes from --height, the lens
    file, or is 1 m. Raises InputError, ModelError or GeometryError for entries that do not fit.
    """
    manifest = read_model(model_path(options.network or DEFAULT)).manifest
    entries: dict[str, Any] = {name: getattr(manifest, name) for name in _ENTRIES}
    given = {name: getattr(options, name) for name in entries}
    if given["shape"] not in (None, "cylinder"):
        entries["object_height"] = 0.0  # the network may be for a cylinder
    entries |= {name: value for name, value in given.items() if value is not None}
    has_height = given["object_height"] is not None or entries["object_height"] > 0.0
    if entries["shape"] == "cylinder" and not has_height:
        raise InputError("a cylinder needs its height; give --object-height")
    shape = make_shape(entries["shape"], entries["radius"], entries["object_height"])
    height = 1.0 if file is None or file.orientation is None else file.orientation.height
    if options.height is not None:
        height = parse_length(options.height, "--height")
    plan = MeshPlan(
        shape,
        positive("--height", height),
        positive("--intersections", entries["intersections"]),
        positive("--max-distance", entries["max_distance"]),
    )
    if not isinstance(shape, Cylinder):
        shape.spacing(height)  # raises GeometryError for a camera that is too low
    return plan, manifest.mesh


def models_for(options: argparse.Namespace, plan: MeshPlan) -> list[str]:
    """The models of --model, or else all models for the shape and height of a plan.

    wall6 is for cylinders only. The others need a camera above the object.
    """
    if options.model:
        return list(options.model)
    cylinder = plan.shape if isinstance(plan.shape, Cylinder) else None
    tall = cylinder is not None and cylinder.object_height >= plan.height
    return [name for name in MESH_MODELS if (cylinder is not None if name == "wall6" else not tall)]


def lens_file(options: argparse.Namespace) -> LensFile | None:
    """The lens file of --lens, if it is given. Raises InputError."""
    return None if options.lens is None else read_lens_file(options.lens)


def orientation_of(options: argparse.Namespace, file: LensFile, height: float) -> Orientation:
    """The orientation from --roll and --pitch, or else from the lens file, at a height [m].

    Raises InputError if neither gives the height and the pitch.
    """
    if file.orientation is None and None in (options.height, options.pitch):
        raise InputError(f"{options.lens} does not have the orientation of the camera; give --height and --pitch")
    pitch, roll = (0.0, 0.0) if file.orientation is None else (file.orientation.pitch, file.orientation.roll)
    return Orientation.from_roll_pitch(
        height,
        roll if options.roll is None else parse_angle(options.roll, "--roll"),
        pitch if options.pitch is None else parse_angle(options.pitch, "--pitch"),
    )


def image_size(options: argparse.Namespace, file: LensFile) -> Size:
    """The size of the pictures [px], from --size or else from the lens file. Raises InputError without either."""
    size = parse_size(options.size) if options.size is not None else file.lens.size
    if size is None:
        raise InputError("the lens file does not have the size of the pictures; give --size")
    return size


def check_distances(name: str, given: Sequence[float]) -> None:
    """Raise InputError unless all distances of an option are numbers from 0 to a million meters."""
    for each in given:
        if not 0.0 <= each < 1e6:
            raise InputError(f"{name} must be a number from 0 to a million meters, not {each:g}")


def distances_or(given: Sequence[float] | None, default: Floats) -> Floats:
    """The distances [m] of --distance in order, or the default without any. Raises InputError."""
    if not given:
        return default
    check_distances("--distance", given)
    return np.array(sorted(given))


def positive(name: str, value: float) -> float:
    """The value of an option, checked. Raises InputError unless it is finite and above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be a number above 0, not {value}")
    return value
