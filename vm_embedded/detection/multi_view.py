"""One detector, several cameras and several planes: what they see of the same world, put together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Floats, Image
from ..errors import GeometryError, InputError
from ..geometry.lens import Lens
from ..geometry.planes import GROUND, Plane, Pose
from .detections import Detection
from .detector import Detector


@dataclass(frozen=True, eq=False)
class View:
    """A camera's picture: uint8 in the detector's pixel format, its lens, and where the camera was."""

    image: Image
    lens: Lens
    pose: Pose


@dataclass(frozen=True, eq=False)
class Sighting:
    """An object in the world frame.

    camera, plane: names of the view and the plane of its clearest detection. position (3,): its center [m]. direction
    (3,): unit vector from that camera. also: the others of the same object, clearest first.
    """

    camera: str
    plane: str
    detection: Detection
    position: Floats
    direction: Floats
    also: tuple[Sighting, ...] = ()


def detect_views(
    detector: Detector, views: Mapping[str, View], planes: Sequence[Plane] = (GROUND,)
) -> tuple[Sighting, ...]:
    """What cameras, by their names, show on planes; the clearest first.

    All use the detector's network and share its meshes. Two detections of one class are one object if they lie on the
    same plane less than a diameter apart and are of different cameras, or if one camera sees them on different planes
    less than their angular radius apart: then only one of the planes can be right. The nearest are put together first,
    and no object has two detections of one camera on one plane. Where planes disagree, that with the most confidence in
    sum counts. A camera that is not before a plane, or too near it for the mesh, sees nothing on it.

    Raises InputError for no planes, planes of one name, or a picture that does not fit.
    """
    names = [each.name for each in planes]
    if not planes or len(set(names)) != len(names):
        raise InputError(f"planes must be one or more with different names, not {names}")
    if not isinstance(views, Mapping):
        raise InputError(f"views must be a table of cameras' names and views, not a {type(views).__name__}")
    found: list[Sighting] = []
    for camera, view in views.items():
        for plane in planes:
            found += _sightings(detector, camera, view, plane)
    pairs = []
    for i, one in enumerate(found):
        for j, other in enumerate(found[:i]):
            apart = _apart(one, other, 2.0 * detector.shape.radius)
            if apart < 1.0:
                pairs.append((apart, i, j))
    group_of = [[each] for each in range(len(found))]
    for _, i, j in sorted(pairs):
        one_group, other_group = group_of[i], group_of[j]
        seen = [(found[each].camera, found[each].plane) for each in one_group + other_group]
        if one_group is not other_group and len(set(seen)) == len(seen):
            one_group += other_group
            for each in other_group:
                group_of[each] = one_group
    groups = {id(each): each for each in group_of}.values()
    together = [_together([found[each] for each in group]) for group in groups]
    return tuple(sorted(together, key=lambda each: -each.detection.confidence))


def _sightings(detector: Detector, camera: str, view: View, plane: Plane) -> Iterator[Sighting]:
    try:
        orientation = plane.seen_from(view.pose)
        detector.cache.mesh_height(orientation.height)
    except GeometryError:
        return
    for each in detector.detect(view.image, orientation, view.lens):
        position = plane.to_world(each.position[None], view.pose)[0]
        away = position - view.pose.position
        yield Sighting(camera, plane.name, each, position, away / np.linalg.norm(away))


def _apart(one: Sighting, other: Sighting, diameter: float) -> float:
    """How far apart two sightings are, 1 being too far for one object."""
    if one.detection.class_name != other.detection.class_name:
        return math.inf
    if one.camera != other.camera and one.plane == other.plane:
        return float(np.linalg.norm(one.position - other.position)) / diameter
    if one.camera == other.camera and one.plane != other.plane:
        angle = math.acos(min(max(float(one.direction @ other.direction), -1.0), 1.0))
        return angle / max(one.detection.angular_radius, other.detection.angular_radius)
    return math.inf


def _together(group: Sequence[Sighting]) -> Sighting:
    """One sighting of several of the same object: the clearest on the plane that most speaks for, and the others."""
    sums: dict[str, float] = {}
    for each in group:
        sums[each.plane] = sums.get(each.plane, 0.0) + each.detection.confidence
    ordered = sorted(group, key=lambda each: (-sums[each.plane], -each.detection.confidence))
    return replace(ordered[0], also=tuple(ordered[1:]))
