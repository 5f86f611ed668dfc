"""Where the objects of a picture are in its image. Camera errors of the augmentation move none of these places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.network.manifest import Manifest

from ..data.pictures import Picture
from ..truth.field import read_field, true_uprights
from ..truth.ground_view import GroundView
from ..truth.objects import SceneTruth, piece_centers, read_scene

_VISIBLE = 0.2
"""Share of an object's outline from which a network must find it."""


@dataclass(frozen=True)
class TruePlace:
    """An object of a class, or that a class has objects at unknown places.

    number: of the class. pixel (2,): of a ball's center, or of the base of an upright. width [m]. shown: whether a
    network can find it; None if the places of the class are unknown, and the other entries have no meaning.
    """

    number: int
    pixel: tuple[float, float] = (0.0, 0.0)
    width: float = 1.0
    shown: bool | None = None


def true_places(picture: Picture, scene: Path | None, manifest: Manifest) -> list[TruePlace]:
    """The objects of the classes with peaks that a picture shows, or may show.

    scene: its scene file. Without one, each piece of a mask is an object, and the bases of uprights are unknown. Raises
    InputError for a damaged scene file.
    """
    truth = None if scene is None else read_scene(scene)
    field = None if scene is None else read_field(scene)
    names = [each.name for each in manifest.classes]
    uprights = true_uprights(picture, field, names) if UPRIGHTS.keys() & manifest.peaks else None
    view, found = GroundView.of(picture), []
    for name in manifest.peaks:
        number = names.index(name)
        if name not in UPRIGHTS:
            found += _objects(picture, truth, view, name, number, 2.0 * manifest.object_radius)
        elif uprights is None:
            found.append(TruePlace(number))
        else:
            bases = uprights[UPRIGHTS[name]]
            pixels = view.pixels(np.array([each.position for each in bases]).reshape(-1, 2))
            found += [
                TruePlace(number, (x, y), base.width, base.visible)
                for base, (x, y) in zip(bases, pixels.tolist(), strict=True)
            ]
    return found


def _objects(
    picture: Picture, truth: SceneTruth | None, view: GroundView, name: str, number: int, width: float
) -> list[TruePlace]:
    """The objects of a class of the kind object. width [m]: of those that only the mask shows."""
    if truth is None or not truth.tells(name):
        centers = piece_centers(picture.labels == number)
        return [TruePlace(number, (x, y), width, True) for x, y in centers.tolist()]
    found = []
    for each in truth.objects:
        x, y = view.pixels(np.asarray(each.center[None, :2]), float(each.center[2]))[0].tolist()
        found.append(TruePlace(number, (x, y), 2.0 * each.radius, each.visible >= _VISIBLE))
    return found


def pixels_of(places: Sequence[TruePlace]) -> Floats:
    """The pixels (o, 2) of places."""
    return np.array([each.pixel for each in places], dtype=np.float64).reshape(-1, 2)
