"""The shifts of a mesh network: from each point that shows an object to the object's center.

They are linear in what the last layer sees of the points, its fields. So the best ones follow from sums over all
points (least squares), and the other answers of the network stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.network.layout import Layout
from vm_export.checkpoint import Checkpoint

from ..data.classes import Classes
from ..data.picture_files import PictureFiles
from ..evaluation.answers import ExactSubject, TorchNetwork
from .configuration import PatchSettings
from .labels import OBJECT, label_places
from .observing import Observer

_REACH = 1.2
"""Distance from an object's center up to which points learn their shift [expected radii]. A point at its border may be
likely, too, because it shows the mean color around it."""

_DAMPING = 1e-6
"""Share of the mean square of a field's entries that is added to each: some entries may be the same for all points."""

_FEWEST = 10
"""Points that a fit needs, for each weight."""


@dataclass
class ShiftFit:
    """Sums over the points of objects, from which the shifts follow.

    products (F + 1, F + 1): of entries of the fields, of which the last one is 1. moments (F + 1, 2): of these with the
    shifts. points, squares: number of the points, and sum of the squares of their shifts. objects: number of them.
    faults: the reason for each picture that was not used.
    """

    products: Floats
    moments: Floats
    points: int = 0
    squares: float = 0.0
    objects: int = 0
    faults: list[str] = field(default_factory=list)

    @classmethod
    def empty(cls, fields: int) -> ShiftFit:
        """Without any point; fields: number of entries, F."""
        return cls(np.zeros((fields + 1, fields + 1)), np.zeros((fields + 1, 2)))

    def add(self, fields: Singles, shifts: Singles) -> None:
        """Add the points of a picture: their fields (k, F) and shifts (k, 2)."""
        known = np.append(fields.astype(np.float64), np.ones((len(fields), 1)), axis=1)
        self.products += known.T @ known
        self.moments += known.T @ shifts
        self.points += len(fields)
        self.squares += float((shifts.astype(np.float64) ** 2).sum())

    def weights(self) -> Floats:
        """The weights (F + 1, 2) of the best shifts. Raises InputError if there are too few points."""
        wanted = _FEWEST * len(self.products)
        if self.points < wanted:
            raise InputError(
                f"{self.points} points on {self.objects} objects are too few for {len(self.products)} weights, which "
                f"need {wanted}: give more pictures"
            )
        damping = _DAMPING * np.trace(self.products) / len(self.products)
        return np.asarray(np.linalg.solve(self.products + damping * np.eye(len(self.products)), self.moments))

    @property
    def errors(self) -> tuple[float, float]:
        """Root mean square of the distance from the points to the centers, without and with the shifts [radii]."""
        weights = self.weights()
        left = self.squares - 2.0 * (weights * self.moments).sum() + (weights * (self.products @ weights)).sum()
        return (self.squares / self.points) ** 0.5, (max(float(left), 0.0) / self.points) ** 0.5


def fit_shifts(
    checkpoint: Checkpoint,
    object_class: str,
    classes: Classes,
    pictures: Sequence[PictureFiles],
    report: Callable[[], None],
) -> ShiftFit:
    """The sums for the shifts of a network without any, to the objects of a class in labeled pictures.

    classes: colors of its classes in masks. report: is called after each picture. Pictures that can't be used are
    faults.
    """
    network = _FieldNetwork(checkpoint)
    manifest = replace(checkpoint.manifest, layout="plain")
    subject = ExactSubject(manifest, checkpoint.grid, "", Settings(), network)
    observer = Observer(subject, classes, manifest, object_class, PatchSettings(), None)
    found = ShiftFit.empty(checkpoint.network.typed_layers[-1].linear.in_features)
    for files in pictures:
        try:
            _add_picture(found, observer, network, files)
        except (InputError, GeometryError) as error:
            found.faults.append(f"picture {files.number}: {' '.join(str(error).split())}")
        report()
    return found


def _add_picture(found: ShiftFit, observer: Observer, network: _FieldNetwork, files: PictureFiles) -> None:
    seen = observer.observe(files)
    view = seen.observation.view
    shown = np.flatnonzero(seen.observation.projected.on_screen)
    places = Tangents.at(view, view.shape.center_along(view.layout.rays[shown], view.height))
    labels = label_places(places, replace(seen.truths, near=_REACH, far=_REACH))
    rows = labels.labels == OBJECT
    found.add(network.fields[shown[rows]], labels.targets[rows, :2])
    found.objects += len(np.unique(labels.of[rows]))


class _FieldNetwork(TorchNetwork):
    """A network that keeps the fields (m, F) of the points of its last call."""

    fields: Singles

    def run(self, layout: Layout, colors: Singles, on_screen: Mask) -> Singles:
        self.fields = self.outputs(self.network.fields, layout, colors, on_screen)
        return super().run(layout, colors, on_screen)
