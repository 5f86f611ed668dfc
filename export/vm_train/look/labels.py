"""Labels of places: whether an object is there, and where and how large it is in the place's patch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest

from ..data.pictures import Picture
from ..scores.overlaps import TrueObject
from ..truth.field import FieldScene, field_truth
from ..truth.objects import SceneTruth, true_objects

NOTHING, OBJECT, UNLABELED = 0, 1, -1

NEAR, FAR = 0.9, 1.3
"""Distances of a place from a true center, in the object's expected radii: up to `NEAR` the object is at the place,
from `FAR` on it is not. A place between them is unlabeled."""

ALIKE, UNLIKE = math.log(4.0 / 3.0), math.log(5.0 / 3.0)
"""Differences between the true and the expected size, as a logarithm: up to `ALIKE` they agree; from `UNLIKE` on they
do not, and the place shows no object. A place between them is unlabeled."""

VISIBLE = 0.25
"""Objects with a smaller visible share give no label: places near them are unlabeled."""


@dataclass(frozen=True, eq=False)
class Truths:
    """True objects: centers (t, 3) relative to the camera in the mesh frame [m], radii (t,) [m], of tall objects half
    their heights, and visible shares (t,) of their outlines.

    sizes (t,): logarithms of the sizes that the network learns over the radii; None for the radii themselves.
    """

    centers: Floats
    radii: Floats
    visible: Floats
    sizes: Floats | None = None

    def __len__(self) -> int:
        return len(self.centers)

    @classmethod
    def none(cls) -> Truths:
        """No objects."""
        return cls(np.empty((0, 3)), np.empty(0), np.empty(0))


@dataclass(frozen=True, eq=False)
class PlaceLabels:
    """Labels of n places.

    labels (n,): NOTHING, OBJECT or UNLABELED. targets (n, 3): shift of the object's center to the right and down, in
    expected radii, and the logarithm of its apparent radius over the expected one; 0 without an object. of (n,):
    number of the object, -1 without one.
    """

    labels: npt.NDArray[np.int8]
    targets: Singles
    of: npt.NDArray[np.int64]


def label_places(places: Tangents, truths: Truths) -> PlaceLabels:
    """Labels of places, whose `radius` is that of the object that is expected there."""
    right, down, off, size = _differences(places, truths)
    found = label_by_differences(right, down, off, size, truths.visible >= VISIBLE)
    if truths.sizes is not None:
        # Added to the size of the radius, which depends on how large the patch is cut; 0 for places without an object.
        found.targets[:, 2] += np.append(truths.sizes, 0.0)[found.of]
    return found


def label_by_differences(right: Floats, down: Floats, off: Floats, size: Floats, visible: Mask) -> PlaceLabels:
    """Labels of n places from their differences (n, t) to t objects.

    right, down: shift of the object's center from the place, off: its length, all in expected radii. size: logarithm of
    the object's size over the expected one. visible (t,): whether enough of the object is visible to give a label.
    """
    count, objects = off.shape
    if not objects:
        return PlaceLabels(
            np.zeros(count, np.int8), np.zeros((count, 3), np.float32), np.full(count, -1, dtype=np.int64)
        )
    maybe = (off < FAR) & (np.abs(size) < UNLIKE)
    surely = (off <= NEAR) & (np.abs(size) <= ALIKE) & visible
    nearest = np.where(surely, off, np.inf).argmin(axis=1)
    has_object = np.asarray(surely.any(axis=1))
    labels = np.where(has_object, OBJECT, np.where(maybe.any(axis=1), UNLABELED, NOTHING)).astype(np.int8)
    targets = np.stack([right, down, size], axis=-1)[np.arange(count), nearest]
    targets = np.where(has_object[:, None], targets, 0.0).astype(np.float32)
    return PlaceLabels(labels, targets, np.where(has_object, nearest, -1))


def _differences(places: Tangents, truths: Truths) -> tuple[Floats, Floats, Floats, Floats]:
    """For n places and t objects (n, t): shift of the center to the right and down, in expected radii, its distance,
    which is infinite for an object behind the camera, and the logarithm of its size over the expected one."""
    distance = np.linalg.norm(truths.centers, axis=1)
    rays = truths.centers / distance[:, None]
    cosine = places.axes @ rays.T
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (cosine * places.radius[:, None])
        right, down = (places.right @ rays.T) * scale, (places.down @ rays.T) * scale
        off = np.where(cosine > 0.0, np.hypot(right, down), np.inf)
    radius = truths.radii / np.sqrt(np.maximum(distance**2 - truths.radii**2, 1e-12))
    size = np.log(radius) - np.log(places.radius)[:, None]
    return right, down, off, size


def find_truths(
    picture: Picture, scene: SceneTruth | None, manifest: Manifest, view: PreparedView, object_class: str
) -> Truths:
    """The true objects of a class in a picture, from its scene or its mask.

    manifest: with the classes of the mask, for objects of the view's shape.
    """
    found = true_objects(picture, scene, manifest)[object_class]
    known = [each for each in found if np.isfinite(each.position).all()]
    if not known:
        return Truths.none()
    positions = np.stack([each.position for each in known])
    centers = (positions - (0.0, 0.0, view.height)) @ view.heading
    if scene is not None and scene.tells(object_class):
        radii = np.array([each.shape.half_size for each in scene.objects])
        return Truths(centers, radii, np.array([each.visible for each in scene.objects]))
    shares = np.array([_visible_share(view, center, each) for center, each in zip(centers, known, strict=True)])
    return Truths(centers, np.full(len(known), view.shape.half_size), shares)


_NARROWEST, _WIDEST = 0.02, 3.0
"""Limits of the width of an upright [m]."""


def true_bases(
    picture: Picture, scene: FieldScene | None, names: Sequence[str], view: PreparedView, kind: str
) -> Truths:
    """The true bases of the uprights of a kind in a picture.

    names: of the classes, in the order of the labels. view: of circles around bases. Raises InputError if the scene
    does not tell what stands on the plane.
    """
    uprights = field_truth(picture, scene, names).uprights
    if uprights is None:
        raise InputError("its scene file does not tell what stands on the plane: render it with vm-synth again")
    found = uprights[kind]
    if not found:
        return Truths.none()
    places = np.stack([np.append(each.position, -view.height) for each in found])
    widths = np.clip([each.width for each in found], _NARROWEST, _WIDEST)
    return Truths(
        centers=places @ view.heading,
        radii=np.full(len(found), view.shape.half_size),
        visible=np.array([float(each.visible) for each in found]),
        sizes=np.log(widths / (2.0 * view.shape.half_size)),
    )


def _visible_share(view: PreparedView, center: Floats, shown: TrueObject) -> float:
    """Visible share of an object, from the area of its mask and that of the outline that it should have."""
    outline = view.outline(center)
    x, y = outline.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    return min(math.pi * shown.radius**2 / area, 1.0) if area > 0.0 else 0.0
