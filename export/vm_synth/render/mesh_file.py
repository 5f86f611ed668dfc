"""Reads a mesh of the user with Mitsuba."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Indices, Singles
from vm_embedded.errors import InputError, one_line
from vm_embedded.files import library_path

from ..bodies.solids import Solid, rotation
from .mitsuba import load_mitsuba

SUFFIXES = (".obj", ".ply")

_MOST = 20_000  # triangles; a scene has several objects, and the tracer's buffers are fixed


def read_mesh(path: Path, up: str) -> Solid:
    """The mesh of an OBJ or PLY file, white; up: its axis that points up, y or z.

    Raises InputError for a file that can't be read, that is flat, or that has too many triangles.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"mesh {path} must be an .obj or .ply file")
    if not path.is_file():
        raise InputError(f"there is no mesh {path}")
    mi = load_mitsuba()
    try:
        with library_path(path.resolve()) as name:
            loaded: Any = mi.load_dict({"type": path.suffix[1:].lower(), "filename": name})
        values = mi.traverse(loaded)
        vertices = _rows(values["vertex_positions"], np.float32)
        triangles = _rows(values["faces"], np.int32)
        normals = _rows(values["vertex_normals"], np.float32) if loaded.has_vertex_normals() else None
    except (RuntimeError, KeyError) as error:
        raise InputError(f"mesh {path} can't be read: {one_line(error)}") from error
    if not len(triangles) or not np.isfinite(vertices).all():
        raise InputError(f"mesh {path} has no triangles, or coordinates that are not numbers")
    if len(triangles) > _MOST:
        raise InputError(f"mesh {path} has {len(triangles)} triangles; simplify it to at most {_MOST}")
    if (np.ptp(vertices, axis=0) <= 0.0).any():
        raise InputError(f"mesh {path} is flat: it must have a width, a depth and a height")
    solid = Solid(
        vertices,
        _vertex_normals(vertices, triangles) if normals is None or not np.abs(normals).any() else normals,
        triangles,
        np.ones_like(vertices),
        np.full(len(vertices), 0.5, dtype=np.float32),
    )
    return solid.turned(rotation(roll=np.pi / 2.0)) if up == "y" else solid


def _rows(values: Any, kind: type[Any]) -> Any:
    return np.asarray(values.numpy(), dtype=kind).reshape(-1, 3)


def _vertex_normals(vertices: Singles, triangles: Indices) -> Singles:
    """Unit normals (n, 3) of vertices: the means of those of their triangles, weighted by area."""
    corners = vertices[triangles].astype(np.float64)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros(vertices.shape)
    for corner in range(3):
        np.add.at(sums, triangles[:, corner], faces)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0.0, sums / np.maximum(length, 1e-30), (0.0, 0.0, 1.0)).astype(np.float32)
