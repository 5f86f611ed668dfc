"""The teacher: a trained network whose probabilities the new network learns, besides the labels.

Its weights stay as they are. It must work on the same mesh, classes and colors as the new network.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.network.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.grid import Grid
from vm_export.network import Network

from .same_mesh import check_same_mesh


@dataclass(frozen=True, eq=False)
class Teacher:
    """A trained network. sha256: digest of its file."""

    network: Network
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, grid: Grid) -> Teacher:
        """Read a checkpoint. Raises InputError if its mesh, classes or grid differ from those given."""
        checkpoint = Checkpoint.load(path)
        check_same_mesh(path, checkpoint, manifest, grid)
        return cls(checkpoint.network, hashlib.sha256(path.read_bytes()).hexdigest())
