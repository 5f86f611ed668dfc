"""Checkpoints: a network and its manifest in one .pt file of plain values and tensors."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError, ModelError, one_line
from vm_embedded.network.manifest import Manifest

from .canvas_shape import CanvasShape
from .grid import VISUAL, Grid
from .look_checkpoint import LOOK_FORMAT
from .mesh_networks import MeshNetwork, new_network, read_shape
from .torch_files import load_values, save_values

_FORMAT = "vm-embedded checkpoint 3"


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A trained network and the manifest of its model file, which has no self-test yet. Raises ModelError."""

    network: MeshNetwork
    manifest: Manifest
    grid: Grid = VISUAL

    def __post_init__(self) -> None:
        shape, manifest = self.network.shape, self.manifest
        if isinstance(shape, CanvasShape) != (manifest.mesh == "octaves"):
            raise ModelError(f"mesh {manifest.mesh} is for another kind of network")
        if shape.classes != len(manifest.classes):
            raise ModelError(
                f"the network has {shape.classes} outputs, but the manifest names {len(manifest.classes)} classes"
            )
        if isinstance(shape, CanvasShape):
            return
        if shape.neighbors != manifest.neighbors:
            raise ModelError(
                f"the network is for {shape.neighbors} neighbors, but mesh {manifest.mesh} has {manifest.neighbors}"
            )

    def save(self, path: str | Path) -> None:
        """Write the checkpoint. Raises InputError."""
        content = {
            "format": _FORMAT,
            "network": self.network.shape.as_dict(),
            "grid": asdict(self.grid),
            "manifest": json.loads(replace(self.manifest, self_test=None).as_json()),
            "state": self.network.state_dict(),
        }
        save_values(path, content)

    @classmethod
    def load(cls, path: str | Path) -> Checkpoint:
        """Read a checkpoint without executing anything in it. Raises InputError or ModelError."""
        content = load_values(path, "a checkpoint")
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            if isinstance(content, dict) and content.get("format") == LOOK_FORMAT:
                raise InputError(f"{path} is a close look; attach it to a network: vm-export MODEL --look {path}")
            raise InputError(f"{path} is not a checkpoint of format {_FORMAT!r}; train the network again")
        missing = [key for key in ("network", "state", "manifest", "grid") if not isinstance(content.get(key), dict)]
        if missing:
            raise InputError(f"{path} is not a whole checkpoint: it lacks {', '.join(missing)}")
        try:
            return cls._from_dict(content)
        except (InputError, ModelError) as error:
            raise type(error)(f"{path}: {error}") from error

    @classmethod
    def _from_dict(cls, content: Mapping[str, Any]) -> Checkpoint:
        """Inverse of what `save` writes. Raises InputError or ModelError."""
        network = new_network(read_shape(content["network"]))
        try:
            network.load_state_dict(content["state"])
        except (RuntimeError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"the weights do not fit the network: {one_line(error)}") from error
        try:
            grid, manifest = Grid(**content["grid"]), json.dumps(content["manifest"])
        except (TypeError, ValueError) as error:
            raise InputError(f"its grid or manifest can't be read: {one_line(error)}") from error
        return cls(network.eval(), Manifest.from_json(manifest), grid)
