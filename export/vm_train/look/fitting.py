"""What a close look judges, and whether its mesh network fits."""

from __future__ import annotations

from pathlib import Path

from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.field.features import UPRIGHTS

from ..evaluation.answers import ExactSubject, load_subject
from ..truth.field import CLASSES
from .configuration import LookConfiguration


def load_mesh(path: Path) -> ExactSubject:
    """A mesh network that can propose places. Raises InputError or ModelError."""
    subject = load_subject(path, Settings())
    assert isinstance(subject, ExactSubject)
    if not subject.manifest.peaks:
        raise InputError(
            f"{path}: a close look judges peaks, and this network has none: train one with mesh.model=octaves"
        )
    return subject


def classes_to_judge(configuration: LookConfiguration, subject: ExactSubject, model: str) -> tuple[str, ...]:
    """The classes that the look network judges: all that the mesh network has peaks for.

    Raises InputError if the masks lack one.
    """
    kinds = {each.name: each.kind for each in subject.manifest.classes}
    for name in subject.manifest.peaks:
        in_masks = [each for each, kind in configuration.classes.kinds.items() if kind == kinds[name]]
        if name not in in_masks:
            raise InputError(
                f"{model} has class {name!r}, but those of the kind {kinds[name]} in [classes] are "
                f"{', '.join(in_masks) or 'none'}: give the class and its colors in masks there"
            )
        missing = [each for each in CLASSES if each not in configuration.classes.kinds]
        if name in UPRIGHTS and missing:
            raise InputError(f"the truth about a {name} needs the classes {', '.join(missing)}: add them to [classes]")
    return subject.manifest.peaks
