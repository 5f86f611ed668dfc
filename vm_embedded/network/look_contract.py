"""The description of the look network in a model file's manifest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any

from ..borders.text import name_fault, text_fault
from ..errors import ModelError
from .look_example import LookTest

LOOK_KEY = "visual_mesh_look"
"""Key of the look network, an ONNX file as base64, in the metadata of a model file."""


@dataclass(frozen=True, kw_only=True)
class JudgedClass:
    """A class that a look network judges.

    name: of the class.
    upright_radius: for a class of kind upright, the radius of the circle on the plane that takes the place of the
        object [m]: it is around the base, and a patch shows a fixed multiple of it. 0 for a class of kind object, whose
        radius the manifest has.
    mesh_weight: how much the score of a peak of the mesh network counts beside the look's answer, 0 to 100: it is added
        so many times to the answer's log-odds.
    calibrated_on: the answers that its probability fits, in words; the runtime does not use it.

    Raises ModelError for values out of range.
    """

    name: str
    upright_radius: float = 0.0
    mesh_weight: float = 0.0
    calibrated_on: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ModelError(f"a class of the close look must be a name, not {self.name!r}")
        if fault := name_fault(self.name):
            raise ModelError(f"a class of the close look {fault}")
        if not isinstance(self.calibrated_on, str) or (
            self.calibrated_on and (fault := text_fault(self.calibrated_on))
        ):
            raise ModelError(f"calibrated_on of the close look must be a text, not {self.calibrated_on!r:.100}")
        for name in ("upright_radius", "mesh_weight"):
            check_number(f"{name} of the close look", getattr(self, name), 0.0, 100.0)


@dataclass(frozen=True, kw_only=True)
class LookContract:
    """What the runtime must know to cut patches for a look network.

    classes: that it judges, in the order of its answers; their names differ.
    size: samples along each side of a patch, 8 to 128.
    extent: half the side of a patch [expected radii], 0.5 to 8.
    max_proposals: largest number of peaks of each class that it judges in a picture, 1 to 128.
    channels: of the network's convolutions at each resolution; the runtime does not use them.
    self_test: an example with its answers, which each loading of the model file runs.
    provenance: origin of the network; the runtime does not use it.

    Raises ModelError for values out of range.
    """

    classes: tuple[JudgedClass, ...]
    size: int
    extent: float
    max_proposals: int
    channels: tuple[int, ...] = ()
    self_test: LookTest | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.classes or len(set(self.names)) < len(self.classes):
            raise ModelError(f"classes of the close look must be at least one, and differ, not {list(self.names)}")
        check_provenance(self.provenance)
        check_number("size of the close look", self.size, 8, 128, whole=True)
        check_number("extent of the close look", self.extent, 0.5, 8.0)
        check_number("max_proposals of the close look", self.max_proposals, 1, 128, whole=True)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the classes."""
        return tuple(each.name for each in self.classes)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {each.name: getattr(self, each.name) for each in fields(self)} | {
            "classes": [asdict(each) for each in self.classes],
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
            raise ModelError(f"the look in the model's manifest must have the entries {sorted(names)}, not {found!r}")
        try:
            classes = tuple(JudgedClass(**each) for each in data["classes"])
            channels = tuple(int(each) for each in data["channels"])
            provenance = {str(key): str(value) for key, value in data["provenance"].items()}
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise ModelError(
                f"the look in the model's manifest has malformed classes, channels or provenance: {error}"
            ) from error
        read = {"classes": classes, "channels": channels, "provenance": provenance, "self_test": None}
        contract = cls(**data | read)
        if data["self_test"] is None:
            return contract
        return replace(contract, self_test=LookTest.from_dict(data["self_test"], contract.size, len(classes)))


def check_number(name: str, value: object, low: float, high: float, whole: bool = False) -> None:
    """Raises ModelError for a value that is no number in this range, or not a whole one."""
    right_kind = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if not right_kind or not low <= value <= high:  # type: ignore[operator]
        kind = "a whole number" if whole else "a number"
        raise ModelError(f"{name} must be {kind} from {low:g} to {high:g}, not {value!r}")


def check_provenance(provenance: Mapping[str, str]) -> None:
    """Raises ModelError for a name or a text that can't be printed, or is too long."""
    for name, text in provenance.items():
        if fault := name_fault(name):
            raise ModelError(f"name {name!r} in the provenance of a network {fault}")
        if fault := text_fault(text):
            raise ModelError(f"{name} in the provenance of a network {fault}")
