"""What the mesh network and the truth say about a picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vm_embedded.detection.looking import around_bases
from vm_embedded.detection.observation import Observation
from vm_embedded.detection.peaks import Peaks
from vm_embedded.errors import InputError
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.network.manifest import Manifest

from ..data.classes import Classes
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures, read_picture
from ..evaluation.answers import ExactSubject
from ..truth.field import read_field
from ..truth.objects import SceneTruth, read_scene
from .labels import Truths, find_truths, true_bases
from .run import LookRun


@dataclass(frozen=True)
class RunPicture:
    """A picture: its files, its position in the run's list, and whether it is for validation."""

    files: PictureFiles
    position: int
    validates: bool


def items_of(run: LookRun) -> list[RunPicture]:
    """All pictures of a run. Raises InputError if the folder lost one."""
    files = {each.number: each for each in find_pictures(run.data)}
    lost = [number for number in run.numbers if number not in files]
    if lost:
        raise InputError(
            f"{run.data} lacks picture {lost[0]}, which the training began with; if the pictures were moved, give "
            "their folder with --data"
        )
    validation = set(run.split.validation)
    return [RunPicture(files[number], position, number in validation) for position, number in enumerate(run.numbers)]


@dataclass(frozen=True, eq=False)
class Observed:
    """A picture after the mesh network: the peaks of the judged class, and the true objects."""

    observation: Observation
    peaks: Peaks
    truths: Truths


@dataclass(frozen=True, eq=False)
class Observer:
    """The mesh network of a run.

    classes: colors in masks. in_masks: a manifest with the classes of the masks. upright_radius: of the circles
    around bases [m], for a class of kind upright. kind: of uprights, None for objects.
    """

    subject: ExactSubject
    classes: Classes
    in_masks: Manifest
    object_class: str
    upright_radius: float
    kind: str | None

    @classmethod
    def of(cls, run: LookRun) -> Observer:
        """Read the mesh network. Raises InputError or ModelError."""
        subject, table = run.subject(), run.configuration.classes
        in_masks = replace(subject.manifest, classes=table.outputs, looks=(), peaks=(), self_test=None)
        name = run.object_class
        kinds = {each.name: each.kind for each in subject.manifest.classes}
        kind = UPRIGHTS[name] if kinds[name] == "upright" else None
        return cls(subject, table.mask_classes(), in_masks, name, run.upright_radius, kind)

    def observe(self, files: PictureFiles) -> Observed:
        """Raises InputError or GeometryError for a picture that can't be used."""
        picture = read_picture(files, self.classes)
        scene = read_scene(files.scene)
        observation = self.subject.observe(picture, self._radius(scene))
        manifest, peaks = observation.manifest, observation.peaks[self.object_class]
        if self.kind is not None:
            view = around_bases(observation, self.upright_radius)
            truths = true_bases(picture, read_field(files.scene), self.classes.names, view, self.kind)
            return Observed(replace(observation, view=view), peaks.apart(view), truths)
        in_masks = replace(self.in_masks, radius=manifest.radius, object_radius=manifest.object_radius)
        return Observed(observation, peaks, find_truths(picture, scene, in_masks, observation.view, self.object_class))

    def _radius(self, scene: SceneTruth | None) -> float | None:
        """Radius of the objects to look for [m]: that of the scene, if the mesh network is for any radius."""
        return scene.radius if scene is not None and self.subject.manifest.any_radius else None
