"""Trained networks that take part in the training of another one: the one that looks first, and the teacher.

Their weights stay as they are. They must work on the same mesh, classes and colors as the new network.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.grid import VISUAL, Grid
from vm_export.network import Network
from vm_export.second_look import Gate, SecondLook

from .labeled_graph import LabeledGraph

_MUST_MATCH = ("shape", "radius", "intersections", "mesh", "classes", "any_radius", "sampling", "colors")
"""Entries of the manifests that two networks on one mesh share. The reach of the mesh may differ: near points are the
same."""


@dataclass(frozen=True, eq=False)
class FrozenNetwork:
    """A trained network. sha256: digest of its file."""

    checkpoint: Checkpoint
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, grid: Grid) -> FrozenNetwork:
        """Read a checkpoint. Raises InputError if its mesh, classes or grid differ from those given."""
        checkpoint = Checkpoint.load(path)
        for name in _MUST_MATCH:
            theirs, ours = getattr(checkpoint.manifest, name), getattr(manifest, name)
            if theirs != ours:
                raise InputError(f"{path} was trained with another {name}: {theirs}, not {ours}")
        if checkpoint.grid != grid:
            raise InputError(f"{path} was trained with another grid: {checkpoint.grid}, not {grid}")
        return cls(checkpoint, hashlib.sha256(path.read_bytes()).hexdigest())


@dataclass(frozen=True, eq=False)
class FirstLook:
    """The network of vm-train --first. Its gate selects the points that the new network gets. sha256: of its file."""

    network: Network
    gate: Gate
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, above: float, rings: int) -> FirstLook:
        """Read a checkpoint. Raises InputError if it does not suit a second look with this manifest.

        above, rings: settings of the gate, which selects points of the classes of kind "object".
        """
        found = FrozenNetwork.load(path, manifest, VISUAL)
        if found.checkpoint.network is not found.checkpoint.last_network:
            raise InputError(f"{path} can't look first: it already has a second look; give a single network")
        objects = tuple(at for at, each in enumerate(manifest.classes) if each.kind == "object")
        if not objects:
            raise InputError("a second look finds objects: give at least one class of [classes] the kind 'object'")
        return cls(found.checkpoint.last_network, Gate(above, rings, objects), found.sha256)

    @torch.no_grad()
    def selected_part(self, graph: LabeledGraph) -> LabeledGraph:
        """The points of a graph that get a second look."""
        neighbors = torch.tensor(graph.neighbors)
        selected = self.gate.selected(self.network(torch.from_numpy(graph.points), neighbors), neighbors)
        return graph.part(np.flatnonzero(selected.numpy()))

    def followed_by(self, network: Network) -> SecondLook:
        """Both networks as one."""
        return SecondLook(self.network, network, self.gate)
