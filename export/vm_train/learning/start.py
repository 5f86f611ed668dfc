"""The network that a training begins with, instead of random weights."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes
from vm_embedded.network.manifest import Manifest, ObjectClass
from vm_embedded.network.model_file import read_model
from vm_export.canvas_shape import CanvasShape
from vm_export.checkpoint import Checkpoint
from vm_export.mesh_networks import MeshShape
from vm_export.network_weights import network_of

from ..data.class_table import ClassTable
from .configuration import TrainConfiguration

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

_RATE = 0.001
"""Default learning rate: with that of a training from random weights, the network would forget what it knows."""


@dataclass(frozen=True, eq=False)
class Start:
    """A trained network to begin with. path: its file, a checkpoint or a model file. sha256: digest of that file."""

    path: Path
    checkpoint: Checkpoint
    sha256: str

    @classmethod
    def load(cls, path: Path) -> Start:
        """Read a checkpoint (.pt) or a model file (.onnx). Raises InputError or ModelError."""
        is_model = path.suffix.lower() == ".onnx"
        checkpoint = network_of(read_model(path)) if is_model else Checkpoint.load(path)
        return cls(path, checkpoint, hashlib.sha256(read_bytes(path)).hexdigest())

    @property
    def defaults(self) -> dict[str, dict[str, Any]]:
        """Entries of a train.toml, by section, that describe the network and its mesh."""
        manifest, grid = self.checkpoint.manifest, self.checkpoint.grid
        mesh = {
            "shape": manifest.shape,
            "radius": manifest.radius,
            "object_height": manifest.object_height,
            "radius_of": "scene" if manifest.any_radius else "all",
            "intersections": manifest.intersections,
            "model": manifest.mesh,
            "sampling": manifest.sampling,
            "colors": manifest.colors,
            "max_distance": manifest.max_distance,
            "grid": grid.kind,
            "equal_at": grid.equal_at,
        }
        return {
            "classes": _class_entries(manifest),
            "mesh": mesh,
            "network": _network_entries(self.checkpoint.network.shape),
            "training": {"rate": _RATE},
        }

    def check(self, configuration: TrainConfiguration) -> None:
        """Raise InputError if a configuration describes a network with another mesh, other classes or layers."""
        for name in _MUST_MATCH:
            their_entry, own_entry = getattr(self.checkpoint.manifest, name), getattr(configuration.manifest, name)
            if their_entry != own_entry:
                raise InputError(f"{self.path} was trained with another {name}: {their_entry}, not {own_entry}")
        if self.checkpoint.grid != configuration.grid:
            raise InputError(
                f"{self.path} was trained with another grid: {self.checkpoint.grid}, not {configuration.grid}"
            )
        theirs, ours = self.checkpoint.network.shape, configuration.network_shape
        if theirs != ours:
            raise InputError(f"{self.path} has other layers: {_listed(theirs)}, not {_listed(ours)} as in [network]")


def _class_entries(manifest: Manifest) -> dict[str, dict[str, Any]]:
    """The section [classes]: the usual colors in masks; the background has all that are left.

    A class whose color is unknown has none, so that reading the section asks for it.
    """
    table, names = ClassTable.default(), [each.name for each in manifest.classes]
    usual = table.colors
    free = sorted(set(usual) - set(names), key=lambda name: (table.kinds[name] != "background", name))
    left = [color for name in free for color in usual[name]]
    backgrounds = [each.name for each in manifest.classes if each.kind == "background"]

    def colors(each: ObjectClass) -> list[list[int]]:
        own: Sequence[tuple[int, int, int]] = usual.get(each.name, ())
        others = left if each.name in backgrounds[:1] else []
        return [list(color) for color in (*own, *others)]

    return {each.name: {"kind": each.kind, "colors": colors(each)} for each in manifest.classes}


def _network_entries(shape: MeshShape) -> dict[str, Any]:
    """The section [network]. For layers of several widths or kinds, it describes the first one; `check` refuses it."""
    if isinstance(shape, CanvasShape):
        return {"depth": shape.depth, "width": shape.width}
    first = shape.layers[0]
    activation = {} if len(shape.layers) == 1 else {"activation": first.activation}
    return {"depth": len(shape.layers), "width": first.width, "kind": first.kind, **activation}


def _listed(shape: MeshShape) -> str:
    if isinstance(shape, CanvasShape):
        return f"depth {shape.depth} and width {shape.width} on octaves"
    layers = ", ".join(f"{each.kind} {each.width} {each.activation}" for each in shape.layers)
    return f"[{layers}] with {shape.neighbors} neighbors"
