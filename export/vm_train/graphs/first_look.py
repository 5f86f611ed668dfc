"""A network that is already trained decides which points of a picture the new one learns from: vm-train --first."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.grid import VISUAL
from vm_export.network import Network
from vm_export.second_look import Gate, SecondLook

from .frozen_network import FrozenNetwork
from .labeled_graph import LabeledGraph


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
        found = FrozenNetwork.load(path, manifest, VISUAL)
        if found.checkpoint.network is not found.checkpoint.last_network:
            raise InputError(f"{path} can't look first: it has a second look itself")
        objects = tuple(at for at, each in enumerate(manifest.classes) if each.kind == "object")
        if not objects:
            raise InputError("a second look is for objects, and no class of [classes] is of that kind")
        return cls(found.checkpoint.last_network, Gate(above, rings, objects), found.sha256)

    @torch.no_grad()
    def part(self, graph: LabeledGraph) -> LabeledGraph:
        """The points of a picture that get a second look."""
        neighbors = torch.tensor(graph.neighbors)
        selected = self.gate.selected(self.network(torch.from_numpy(graph.points), neighbors), neighbors)
        return graph.part(np.flatnonzero(selected.numpy()))

    def then(self, network: Network) -> SecondLook:
        """Both networks as one."""
        return SecondLook(self.network, network, self.gate)
