"""The look network that a training begins with, instead of random weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError, unknown
from vm_embedded.network.model_file import read_model
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_network import LookShape
from vm_export.look_weights import looks_of

from .configuration import LookConfiguration

_RATE = 0.005
"""Default learning rate: with that of a training from random weights, the network would forget what it knows."""


@dataclass(frozen=True, eq=False)
class LookStart:
    """A trained look network to begin with. path: its file, a look.pt or a model file."""

    path: Path
    look: LookCheckpoint

    @classmethod
    def load(cls, path: Path, object_class: str = "") -> LookStart:
        """Read a look.pt, or the look of a model file (.onnx) at a class; "": its first one.

        Raises InputError or ModelError.
        """
        is_model = path.suffix.lower() == ".onnx"
        look = _chosen(path, object_class) if is_model else LookCheckpoint.load(path)
        if object_class and look.contract.object_class != object_class:
            raise InputError(f"{path} judges class {look.contract.object_class!r}, not {object_class!r}")
        return cls(path, look)

    @property
    def defaults(self) -> dict[str, dict[str, Any]]:
        """Entries of a look.toml, by section, that describe the network and its patches."""
        contract, shape = self.look.contract, self.look.network.shape
        patches: dict[str, Any] = {
            "object_class": contract.object_class,
            "size": contract.size,
            "extent": contract.extent,
            "max_proposals": contract.max_proposals,
            "passes": contract.passes,
        }
        if contract.upright_radius:
            patches["upright_radius"] = contract.upright_radius
        network = {"channels": list(contract.channels), "hidden": shape.hidden}
        return {"patches": patches, "network": network, "training": {"rate": _RATE}}

    def check(self, configuration: LookConfiguration) -> None:
        """Raise InputError if a configuration describes a network with other patches or layers."""
        patches, contract = configuration.patches, self.look.contract
        theirs, ours = self.look.network.shape, configuration.shape
        if theirs != ours:
            raise InputError(
                f"{self.path} has other layers: {_listed(theirs)}; [patches] and [network] say {_listed(ours)}"
            )
        if contract.extent != patches.extent:
            raise InputError(f"{self.path} has patches.extent {contract.extent:g}, not {patches.extent:g}")


def _listed(shape: LookShape) -> str:
    channels = ", ".join(map(str, shape.channels))
    return f"{shape.size} x {shape.size} samples, channels {channels}, {shape.hidden_units} hidden units"


def _chosen(path: Path, object_class: str) -> LookCheckpoint:
    """The look of a model file at a class; see LookStart.load."""
    looks = looks_of(read_model(path))
    names = [each.contract.object_class for each in looks]
    if not looks:
        raise InputError(f"{path} has no close look")
    if object_class and object_class not in names:
        raise InputError(unknown(f"close look of {path}", object_class, names))
    return looks[names.index(object_class) if object_class else 0]
