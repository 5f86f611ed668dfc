"""Whether a trained network works on the points and classes of a training."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.grid import Grid

_MUST_MATCH = (
    "shape",
    "radius",
    "object_height",
    "intersections",
    "mesh",
    "edge",
    "classes",
    "any_radius",
    "sampling",
    "colors",
)
"""Entries of the manifests that two networks on one mesh share. The reach of the mesh may differ: near points are the
same."""


def check_same_mesh(path: Path, checkpoint: Checkpoint, manifest: Manifest, grid: Grid) -> None:
    """Raise InputError if the mesh, classes or grid of a trained network differ from those of a training.

    path: of the trained network, for the message. manifest, grid: of the training.
    """
    for name in _MUST_MATCH:
        theirs, ours = getattr(checkpoint.manifest, name), getattr(manifest, name)
        if theirs != ours:
            raise InputError(f"{path} was trained with another {name}: {theirs}, not {ours}")
    if checkpoint.grid != grid:
        raise InputError(f"{path} was trained with another grid: {checkpoint.grid}, not {grid}")
