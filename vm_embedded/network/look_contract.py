"""The description of a look network in a model file's manifest, and its example."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ..borders.text import name_fault, text_fault
from ..errors import ModelError
from .look_test import LookTest

LOOK_KEY = "visual_mesh_look"
"""Key of the look network, an ONNX file as base64, in the metadata of a model file. The key for a class of kind upright
ends with the class: visual_mesh_look_goal."""

GLANCE_KEY = "visual_mesh_glance"
"""Key of its glance, in the same form. That of the glance's own glance is visual_mesh_glance2."""

MOST_NETWORKS = 3
"""Limit of the networks in a chain."""


@dataclass(frozen=True, kw_only=True)
class LookContract:
    """What the runtime must know to cut patches for a look network, or for the glance before it.

    object_class: name of the class that it judges.
    upright_radius: for a class of kind upright, the radius of the circle on the plane that takes the place of the
        object [m]: it is around the base, and a patch shows a fixed multiple of it. 0 for a class of kind object, whose
        radius the manifest has.
    size: samples along each side of a patch, 8 to 128.
    extent: half the side of a patch [expected radii], 0.5 to 8.
    above: probability above which a mesh point counts for a proposal, 0 to 0.99.
    passes: how often a proposal is judged at most, 1 to 4; each further pass judges a new patch around the center that
        the previous pass found. In its last pass, a doubtful place gets a second opinion.
    mesh_weight: how much the score of a peak of the mesh network counts beside this network's answer, 0 to 2: it is
        added so many times to the answer's log-odds. That of a glance is not used.
    channels: of the network's convolutions at each resolution; the runtime does not use them.
    glance: of the look network for the same class that judges before this one, which judges only what the glance
        passes on. The glance may have a glance, too; then this one is a wide look.
    self_test: an example with its answers, which each loading of the model file runs.
    provenance: origin of the network; the runtime does not use it.

    Raises ModelError for values out of range.
    """

    object_class: str
    upright_radius: float = 0.0
    size: int
    extent: float
    above: float
    passes: int
    mesh_weight: float = 0.0
    channels: tuple[int, ...] = ()
    glance: LookContract | None = None
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
            ("above", False, 0.0, 0.99),
            ("passes", True, 1, 4),
            ("mesh_weight", False, 0.0, 2.0),
        ):
            value = getattr(self, name)
            right_kind = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
            if not right_kind or not low <= value <= high:
                kind = "a whole number" if whole else "a number"
                raise ModelError(f"{name} of the close look must be {kind} from {low} to {high}, not {value!r}")
        if self.glance is None:
            return
        if len(self.chain) > MOST_NETWORKS:
            raise ModelError(_too_many(len(self.chain)))
        if self.glance.object_class != self.object_class:
            raise ModelError(
                f"the close look judges class {self.object_class!r}, its glance class {self.glance.object_class!r}; "
                "both must judge the same one"
            )
        if self.glance.upright_radius != self.upright_radius:
            raise ModelError(
                f"the close look has the upright_radius {self.upright_radius:g} m, its glance "
                f"{self.glance.upright_radius:g} m; both must be the same"
            )

    @property
    def chain(self) -> tuple[LookContract, ...]:
        """The contract, that of the glance, and that of the glance's glance, as far as there are any."""
        glances = () if self.glance is None else self.glance.chain
        return (self, *glances)

    @property
    def is_wide(self) -> bool:
        """Whether it is a wide look: the third network of its chain."""
        return len(self.chain) == MOST_NETWORKS

    @property
    def names(self) -> tuple[str, ...]:
        """What the chain's networks are called, the last judge first."""
        return ("wide look", "close look", "glance") if self.is_wide else ("close look", "glance")[: len(self.chain)]

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the chain's networks in the metadata of a model file, the last judge first."""
        end = f"_{self.object_class}" if self.upright_radius else ""
        return tuple(key + end for key in (LOOK_KEY, GLANCE_KEY, f"{GLANCE_KEY}2")[: len(self.chain)])

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        data = {each.name: getattr(self, each.name) for each in fields(self)}
        if not self.mesh_weight:  # as in files of earlier releases
            del data["mesh_weight"]
        return data | {
            "channels": list(self.channels),
            "glance": None if self.glance is None else self.glance.as_dict(),
            "provenance": dict(self.provenance),
            "self_test": None if self.self_test is None else self.self_test.as_dict(),
        }

    @classmethod
    def from_dict(cls, data: object, networks: int = MOST_NETWORKS) -> LookContract:
        """Inverse of `as_dict`. networks: most in the chain. Raises ModelError for missing, unknown or malformed
        entries."""
        if not networks:
            raise ModelError(_too_many(MOST_NETWORKS + 1))
        names = {each.name for each in fields(cls)} - {"mesh_weight"}
        if not isinstance(data, dict) or set(data) - {"mesh_weight"} != names:
            found = sorted(data) if isinstance(data, dict) else data
            raise ModelError(f"look in the model's manifest must have the entries {sorted(names)}, not {found!r}")
        try:
            channels = tuple(int(each) for each in data["channels"])
            provenance = {str(key): str(value) for key, value in data["provenance"].items()}
        except (TypeError, ValueError, OverflowError, AttributeError) as error:
            raise ModelError(f"look in the model's manifest has malformed channels or provenance: {error}") from error
        glance = None if data["glance"] is None else cls.from_dict(data["glance"], networks - 1)
        contract = cls(**data | {"channels": channels, "glance": glance, "provenance": provenance, "self_test": None})
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


def _too_many(networks: int) -> str:
    """What is wrong with a chain of so many networks or more."""
    return f"a close look may have {MOST_NETWORKS} networks with all its glances, not {networks}"
