"""What a close look judges, and whether its mesh network and its glance fit."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError, unknown
from vm_embedded.field.uprights import KINDS
from vm_embedded.network.look_contract import MOST_NETWORKS
from vm_export.look_checkpoint import LookCheckpoint

from ..evaluation.answers import ExactSubject, load_subject
from ..truth.field import CLASSES
from .configuration import LookConfiguration


def load_mesh(path: Path) -> ExactSubject:
    """A mesh network that can propose places. Raises InputError or ModelError."""
    subject = load_subject(path, Settings())
    assert isinstance(subject, ExactSubject)
    if not subject.grid.is_visual:
        raise InputError(f"{path}: a close look needs a network on the Visual Mesh, not on a {subject.grid.kind} grid")
    return subject


def class_to_judge(configuration: LookConfiguration, subject: ExactSubject, model: str) -> str:
    """The class that the look network judges. Raises InputError if model or masks do not have it."""
    kinds = {each.name: each.kind for each in subject.manifest.classes}
    objects = [name for name, kind in kinds.items() if kind == "object"]
    uprights = [name for name, kind in kinds.items() if kind == "upright" and name in KINDS]
    if not objects + uprights:
        raise InputError(f"{model} has no class of the kind object, and neither goal nor robot of the kind upright")
    name = configuration.patches.object_class or (objects + uprights)[0]
    if name not in objects + uprights:
        raise InputError(f"[patches] object_class: {unknown(f'object of {model}', name, objects + uprights)}")
    in_masks = [each for each, kind in configuration.classes.kinds.items() if kind == kinds[name]]
    if name not in in_masks:
        raise InputError(
            f"{model} has class {name!r}, but those of the kind {kinds[name]} in [classes] are "
            f"{', '.join(in_masks) or 'none'}: give the class and its colors in masks there"
        )
    missing = [each for each in CLASSES if each not in configuration.classes.kinds]
    if name in uprights and missing:
        raise InputError(f"the truth about a {name} needs the classes {', '.join(missing)}: add them to [classes]")
    return name


def upright_radius_of(configuration: LookConfiguration, object_class: str) -> float:
    """Radius of the circles around bases [m]; 0 for a class of kind object."""
    is_upright = configuration.classes.kinds[object_class] == "upright"
    return configuration.patches.upright_radius if is_upright else 0.0


def check_glance(glance: LookCheckpoint, object_class: str, upright_radius: float) -> None:
    """Raise InputError if a look network can't go before one for this class, and circles of this radius [m]."""
    contract = glance.contract
    if contract.object_class != object_class:
        raise InputError(
            f"the glance of --glance or --start judges class {contract.object_class!r}; a glance for class "
            f"{object_class!r} is needed"
        )
    if len(contract.chain) == MOST_NETWORKS:
        raise InputError(
            f"the look of --glance has {MOST_NETWORKS} networks, and the new one would be another: give one with at "
            f"most {MOST_NETWORKS - 1}"
        )
    if contract.upright_radius != upright_radius:
        raise InputError(
            f"the glance of --glance or --start has an upright_radius of {contract.upright_radius:g} m, "
            f"patches.upright_radius is {upright_radius:g} m: give both the same one"
        )
