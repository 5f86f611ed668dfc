"""A network that is already trained decides which points of a picture the new one learns from: vm-train --first."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from vm_embedded.errors import InputError
from vm_embedded.manifest import Manifest
from vm_export.checkpoint import Checkpoint
from vm_export.network import Network
from vm_export.second_look import Gate, SecondLook

from .graphs import Graph

_ALIKE = ("shape", "radius", "intersections", "mesh", "classes", "any_radius", "sampling", "colors")
"""What two networks must have in common to look at one mesh; how far out it reaches changes nothing near by."""


@dataclass(frozen=True, eq=False)
class FirstLook:
    """The network that looks first, and what it passes on. sha256: of its file."""

    network: Network
    gate: Gate
    sha256: str

    @classmethod
    def load(cls, path: Path, manifest: Manifest, above: float, rings: int) -> FirstLook:
        """Read a checkpoint whose second look is to be for a manifest's mesh and classes. Raises InputError.

        above, rings: of the gate, which is for the classes that are objects.
        """
        checkpoint = Checkpoint.load(path)
        for name in _ALIKE:
            there, here = getattr(checkpoint.manifest, name), getattr(manifest, name)
            if there != here:
                raise InputError(f"{path} was trained with another {name}: {there}, not {here}")
        if checkpoint.network is not checkpoint.last or checkpoint.grid.kind != "visual":
            raise InputError(f"{path} can't look first: it must be a single network on the Visual Mesh")
        objects = tuple(at for at, each in enumerate(manifest.classes) if each.kind == "object")
        if not objects:
            raise InputError("a second look is for objects, and no class of [classes] is of that kind")
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        return cls(checkpoint.last, Gate(above, rings, objects), digest)

    @torch.no_grad()
    def part(self, graph: Graph) -> Graph:
        """The points of a picture that get a second look."""
        neighbors = torch.tensor(graph.neighbors)
        passed = self.gate.passed(self.network(torch.from_numpy(graph.points), neighbors), neighbors)
        return graph.part(np.flatnonzero(passed.numpy()))

    def then(self, network: Network) -> SecondLook:
        """Both networks as one."""
        return SecondLook(self.network, network, self.gate)
