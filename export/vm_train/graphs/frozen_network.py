"""Networks that are already trained and have a part in the training of another: they must see what it sees."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.grid import Grid

_ALIKE = ("shape", "radius", "intersections", "mesh", "classes", "any_radius", "sampling", "colors")
"""What two networks must have in common to look at one mesh; how far out it reaches changes nothing near by."""


@dataclass(frozen=True, eq=False)
class FrozenNetwork:
    """A trained network. sha256: of its file."""

    checkpoint: Checkpoint
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, grid: Grid) -> FrozenNetwork:
        """Read a checkpoint of a manifest's mesh and classes, and of a grid. Raises InputError."""
        checkpoint = Checkpoint.load(path)
        for name in _ALIKE:
            there, here = getattr(checkpoint.manifest, name), getattr(manifest, name)
            if there != here:
                raise InputError(f"{path} was trained with another {name}: {there}, not {here}")
        if checkpoint.grid != grid:
            raise InputError(f"{path} was trained with another grid: {checkpoint.grid}, not {grid}")
        return cls(checkpoint, hashlib.sha256(path.read_bytes()).hexdigest())
