"""What the mesh network and the truth say about a picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vm_embedded.detection.looking import Sought
from vm_embedded.detection.observation import Observation
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.errors import InputError
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.network.look_contract import LookContract
from vm_embedded.network.manifest import Manifest

from ..data.classes import Classes
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures, read_picture
from ..evaluation.answers import ExactSubject
from ..truth.field import read_field
from ..truth.objects import SceneTruth, read_scene
from .labels import VISIBLE, Truths, find_truths, true_bases
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
    """A class in a picture after the mesh network: what is sought at its peaks, and the true objects."""

    sought: Sought
    truths: Truths

    @property
    def view(self) -> PreparedView:
        """The view of objects of the class."""
        return self.sought.view

    @property
    def visible(self) -> int:
        """Number of the true objects of which enough is visible to find them."""
        return int((self.truths.visible >= VISIBLE).sum())


@dataclass(frozen=True, eq=False)
class Observer:
    """The mesh network of a run.

    look: what it is for. classes: colors in masks. in_masks: a manifest with the classes of the masks.
    """

    subject: ExactSubject
    look: LookContract
    classes: Classes
    in_masks: Manifest

    @classmethod
    def of(cls, run: LookRun) -> Observer:
        """Read the mesh network. Raises InputError or ModelError."""
        subject, table = run.subject(), run.configuration.classes
        in_masks = replace(subject.manifest, classes=table.outputs, look=None, peaks=(), self_test=None)
        return cls(subject, run.contract, table.mask_classes(), in_masks)

    def observe(self, files: PictureFiles) -> tuple[Observation, list[Observed]]:
        """A picture after the mesh network, and each class of the look in it.

        Raises InputError or GeometryError for a picture that can't be used.
        """
        picture, scene = read_picture(files, self.classes), read_scene(files.scene)
        observation = self.subject.observe(picture, self._radius(scene))
        field = None if all(not each.upright_radius for each in self.look.classes) else read_field(files.scene)
        in_masks = replace(
            self.in_masks, radius=observation.manifest.radius, object_radius=observation.manifest.object_radius
        )
        seen = []
        for each in self.look.classes:
            sought = Sought.of(observation, each.name, self.look)
            if each.upright_radius:
                truths = true_bases(picture, field, self.classes.names, sought.view, UPRIGHTS[each.name])
            else:
                truths = find_truths(picture, scene, in_masks, sought.view, each.name)
            seen.append(Observed(sought, truths))
        return observation, seen

    def _radius(self, scene: SceneTruth | None) -> float | None:
        """Radius of the objects to look for [m]: that of the scene, if the mesh network is for any radius."""
        return scene.radius if scene is not None and self.subject.manifest.any_radius else None
