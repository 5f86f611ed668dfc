"""The true objects of a picture: from the sceneX.json of vm-synth, or else from the mask."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.errors import InputError
from vm_embedded.files import exists, read_regular
from vm_embedded.geometry.shape import Shape
from vm_embedded.geometry.shapes import Cylinder, Sphere
from vm_embedded.network.manifest import Manifest
from vm_workstation.class_names import class_name
from vm_workstation.outlines import polygon_area, shape_outline

from ..data.pictures import Picture
from ..scores.overlaps import TrueObject, coverage

_UNREADABLE = (InputError, OSError, AttributeError, KeyError, TypeError, ValueError, OverflowError, RecursionError)

BALL = "ball"
"""The class of the object in a sceneX.json that does not name another one."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of a scene: a ball, or a cylinder on the plane.

    center (3,) [m]: in the frame of the picture's orientation. radius [m]. visible: share of its outline. height [m]:
    of a cylinder, 0 for a ball.
    """

    center: Floats
    radius: float
    visible: float
    height: float = 0.0

    @property
    def shape(self) -> Shape:
        """Its shape."""
        return Cylinder(self.radius, self.height) if self.height else Sphere(self.radius)


@dataclass(frozen=True, eq=False)
class SceneTruth:
    """The truth about a picture: the right radius of its objects [m], the objects, and their class.

    in_mask: only the mask shows the objects, in the files of vm-train import-boxes.
    """

    radius: float
    objects: tuple[SceneObject, ...]
    class_name: str = BALL
    in_mask: bool = False

    def tells(self, class_name: str) -> bool:
        """Whether `objects` holds the objects of a class."""
        return class_name == self.class_name and not self.in_mask


def read_scene(path: Path) -> SceneTruth | None:
    """The truth in a sceneX.json; None if the file is missing. Raises InputError naming file and fault."""
    if not exists(path):
        return None
    try:
        table = json.loads(read_regular(path))
        if "object" in table:
            found = tuple(_read_object(each, float(each["height"])) for each in table["objects"])
            truth = SceneTruth(float(table["object"]["radius"]), found, class_name(str(table["object"]["name"])))
        else:
            in_mask = table.keys() == {"ball_radius"}
            ball = None if in_mask else table["ball"]
            found = () if ball is None else (_read_object(ball, 0.0),)
            truth = SceneTruth(float(table["ball_radius"]), found, in_mask=in_mask)
    except _UNREADABLE as error:
        raise InputError(f"{path.name}: is not a scene file of vm-synth: {error!r}") from error
    if not _is_valid(truth):
        raise InputError(
            f"{path.name}: center, radius, height or visible share of its {truth.class_name} is out of range"
        )
    return truth


def _read_object(entry: dict[str, Any], height: float) -> SceneObject:
    center = np.array(entry["center"], dtype=np.float64)
    return SceneObject(center, float(entry["radius"]), float(entry["visible"]), height)


def _is_valid(truth: SceneTruth) -> bool:
    return 0.0 < truth.radius < math.inf and all(_is_valid_object(each) for each in truth.objects)


def _is_valid_object(found: SceneObject) -> bool:
    placed = found.center.shape == (3,) and bool(np.isfinite(found.center).all())
    sized = 0.0 < found.radius < math.inf and 0.0 <= found.height < math.inf
    return placed and sized and 0.0 <= found.visible <= 1.0


def true_objects(picture: Picture, scene: SceneTruth | None, manifest: Manifest) -> dict[str, list[TrueObject]]:
    """The true objects of each class of the kind object.

    With a scene of vm-synth, the scene's class has the scene's objects with their whole outlines. Otherwise each
    connected piece of the mask is an object of the manifest's size; it stands where the mean ray through the piece
    meets the plane.
    """
    shape = manifest.object_shape
    found: dict[str, list[TrueObject]] = {}
    for number, each in enumerate(manifest.classes):
        if each.kind != "object":
            continue
        if scene is not None and scene.tells(each.name):
            found[each.name] = [_of_scene(picture, one) for one in scene.objects]
        else:
            found[each.name] = _of_mask(picture, picture.labels == number, shape)
    return found


def _of_scene(picture: Picture, shown: SceneObject) -> TrueObject:
    lens, orientation, size = picture.fitted_lens, picture.orientation, picture.size
    whole: dict[str, Any] = {"center": shown.center, "size": size}
    window, share = coverage(shape_outline(lens, orientation, shown.shape, **whole), size)
    mask = np.zeros(picture.labels.shape, dtype=np.float32)
    mask[window] = share
    radius = math.sqrt(polygon_area(shape_outline(lens, orientation, shown.shape, **whole, unseen=True)) / math.pi)
    toward = shown.center - (0.0, 0.0, orientation.height)
    distance = float(np.linalg.norm(toward))
    angle = math.asin(min(shown.radius / distance, 1.0))
    return TrueObject(mask, shown.center, radius, shown.visible, toward / distance, angle)


def piece_centers(shown: Mask) -> Floats:
    """The mean pixels (n, 2) of the connected pieces of a mask (h, w)."""
    return np.asarray(cv2.connectedComponentsWithStats(shown.astype(np.uint8), connectivity=8)[3][1:], dtype=np.float64)


def _of_mask(picture: Picture, shown: Mask, shape: Shape) -> list[TrueObject]:
    count, pieces, facts, _ = cv2.connectedComponentsWithStats(shown.astype(np.uint8), connectivity=8)
    areas = facts[1:, cv2.CC_STAT_AREA].tolist()
    masks = (pieces == number for number in range(1, count))
    return [_of_piece(picture, mask, area, shape) for mask, area in zip(masks, areas, strict=True)]


def _of_piece(picture: Picture, mask: Mask, area: float, shape: Shape) -> TrueObject:
    """An object of that shape, from its pixels in a mask (h, w). Above the horizon, its place and size are NaN."""
    orientation, bearing = picture.orientation, _bearing(picture, mask)
    position, angle = np.full(3, np.nan), math.nan
    if bearing[2] < 0.0:
        center = shape.center_along(bearing[None], orientation.height)[0]
        position = center + np.array([0.0, 0.0, orientation.height])
        angle = math.asin(min(shape.radius / float(np.linalg.norm(center)), 1.0))
    return TrueObject(mask, position, math.sqrt(area / math.pi), bearing=bearing, angular_radius=angle)


def _bearing(picture: Picture, mask: Mask) -> Floats:
    """Unit vector (3,) along the mean ray through the pixels of a mask (h, w); NaN if the lens sees none of them."""
    pixels = np.argwhere(mask)[:, ::-1].astype(np.float64)
    rays = picture.fitted_lens.unproject(pixels, picture.size) @ picture.orientation.rotation.T
    rays = rays[np.isfinite(rays).all(axis=1)]
    middle = rays.mean(axis=0) if len(rays) else np.zeros(3)
    length = float(np.linalg.norm(middle))
    return np.asarray(middle / length) if length > 0.0 else np.full(3, np.nan)
