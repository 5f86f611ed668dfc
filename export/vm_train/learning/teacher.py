"""The teacher: a trained network whose probabilities the new network learns, besides the labels.

Its weights stay as they are. It must work on the same mesh, classes and colors as the new network.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.grid import Grid
from vm_export.network import Network

_MUST_MATCH = ("shape", "radius", "intersections", "mesh", "classes", "any_radius", "sampling", "colors")
"""Entries of the manifests that two networks on one mesh share. The reach of the mesh may differ: near points are the
same."""


@dataclass(frozen=True, eq=False)
class Teacher:
    """A trained network. sha256: digest of its file."""

    network: Network
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, grid: Grid) -> Teacher:
        """Read a checkpoint. Raises InputError if its mesh, classes or grid differ from those given."""
        checkpoint = Checkpoint.load(path)
        for name in _MUST_MATCH:
            theirs, ours = getattr(checkpoint.manifest, name), getattr(manifest, name)
            if theirs != ours:
                raise InputError(f"{path} was trained with another {name}: {theirs}, not {ours}")
        if checkpoint.grid != grid:
            raise InputError(f"{path} was trained with another grid: {checkpoint.grid}, not {grid}")
        return cls(checkpoint.network, hashlib.sha256(path.read_bytes()).hexdigest())
