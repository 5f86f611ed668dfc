"""The description of a look network in a model file's manifest, and its example."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ..borders.text import name_fault, text_fault
from ..errors import ModelError
from .look_example import LookTest


def look_key(object_class: str) -> str:
    """Key of the look network at a class, an ONNX file as base64, in the metadata of a model file."""
    return f"visual_mesh_look_{object_class}"


@dataclass(frozen=True, kw_only=True)
class LookContract:
    """What the runtime must know to cut patches for a look network.

    object_class: name of the class that it judges.
    upright_radius: for a class of kind upright, the radius of the circle on the plane that takes the place of the
        object [m]: it is around the base, and a patch shows a fixed multiple of it. 0 for a class of kind object, whose
        radius the manifest has.
    size: samples along each side of a patch, 8 to 128.
    extent: half the side of a patch [expected radii], 0.5 to 8.
    max_proposals: largest number of peaks of the mesh network that it judges in a picture, 1 to 128.
    mesh_weight: how much the score of a peak of the mesh network counts beside this network's answer, 0 to 2: it is
        added so many times to the answer's log-odds.
    channels: of the network's convolutions at each resolution; the runtime does not use them.
    self_test: an example with its answers, which each loading of the model file runs.
    provenance: origin of the network; the runtime does not use it.

    Raises ModelError for values out of range.
    """

    object_class: str
    upright_radius: float = 0.0
    size: int
    extent: float
    max_proposals: int
    mesh_weight: float = 0.0
    channels: tuple[int, ...] = ()
    self_test: LookTest | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.object_class, str):
            raise ModelError(f"object_class of the close look must be a name, not {self.object_class!r}")
        if fault := name_fault(self.object_class):
            raise ModelError(f"object_class of the close look {fault}")
        check_provenance(self.provenance)
        for name, whole, low, high in (
            ("upright_radius", False, 0.0, 100.0),
            ("size", True, 8, 128),
            ("extent", False, 0.5, 8.0),
            ("max_proposals", True, 1, 128),
            ("mesh_weight", False, 0.0, 2.0),
        ):
            value = getattr(self, name)
            right_kind = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
            if not right_kind or not low <= value <= high:
                kind = "a whole number" if whole else "a number"
                raise ModelError(f"{name} of the close look must be {kind} from {low} to {high}, not {value!r}")

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {each.name: getattr(self, each.name) for each in fields(self)} | {
            "channels": list(self.channels),
            "provenance": dict(self.provenance),
            "self_test": None if self.self_test is None else self.self_test.as_dict(),
        }

    @classmethod
    def from_dict(cls, data: object) -> LookContract:
        """Inverse of `as_dict`. Raises ModelError for missing, unknown or malformed entries."""
        names = {each.name for each in fields(cls)}
        if not isinstance(data, dict) or set(data) != names:
            found = sorted(data) if isinstance(data, dict) else data
            raise ModelError(f"a look in the model's manifest must have the entries {sorted(names)}, not {found!r}")
        try:
            channels = tuple(int(each) for each in data["channels"])
            provenance = {str(key): str(value) for key, value in data["provenance"].items()}
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise ModelError(f"a look in the model's manifest has malformed channels or provenance: {error}") from error
        contract = cls(**data | {"channels": channels, "provenance": provenance, "self_test": None})
        if data["self_test"] is None:
            return contract
        return replace(contract, self_test=LookTest.from_dict(data["self_test"], contract.size))


def check_provenance(provenance: Mapping[str, str]) -> None:
    """Raises ModelError for a name or a text that can't be printed, or is too long."""
    for name, text in provenance.items():
        if fault := name_fault(name):
            raise ModelError(f"name {name!r} in the provenance of a network {fault}")
        if fault := text_fault(text):
            raise ModelError(f"{name} in the provenance of a network {fault}")
