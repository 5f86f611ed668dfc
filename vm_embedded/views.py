"""One detector, several cameras and several planes: what they see of the same world, put together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Image
from .detections import Detection
from .detector import Detector
from .errors import GeometryError, InputError
from .lens import Lens
from .planes import GROUND, Plane, Pose


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

    All use the detector's network and share its meshes. Two detections are one object if they are of one class and
    either lie on the same plane less than a radius apart, or are seen by the same camera less than their angular radius
    apart: then only one of two planes can be right. A camera that is not before a plane, or too near it for the mesh,
    sees nothing on it.

    Raises InputError for no planes, planes of one name, or a picture that does not fit.
    """
    names = [each.name for each in planes]
    if not planes or len(set(names)) != len(names):
        raise InputError(f"planes must be one or more with different names, not {names}")
    found: list[Sighting] = []
    for camera, view in views.items():
        for plane in planes:
            found += _sightings(detector, camera, view, plane)
    found.sort(key=lambda each: -each.detection.confidence)
    objects: list[list[Sighting]] = []
    for each in found:
        same = next((group for group in objects if _same(group, each, detector.shape.radius)), None)
        if same is None:
            objects.append([each])
        else:
            same.append(each)
    return tuple(_together(group) for group in objects)


def _sightings(detector: Detector, camera: str, view: View, plane: Plane) -> Iterable[Sighting]:
    try:
        orientation = plane.seen_from(view.pose)
        detections = detector.detect(view.image, orientation, view.lens)
    except GeometryError:
        return
    for each in detections:
        position = plane.to_world(each.position[None], view.pose)[0]
        away = position - view.pose.position
        yield Sighting(camera, plane.name, each, position, away / np.linalg.norm(away))


def _same(group: Sequence[Sighting], other: Sighting, radius: float) -> bool:
    """Whether a sighting is of the object that a group is of."""
    for each in group:
        if each.detection.class_name != other.detection.class_name:
            return False
        if each.plane == other.plane and each.camera != other.camera:
            if np.linalg.norm(each.position - other.position) < radius:
                return True
        elif each.camera == other.camera and each.plane != other.plane:
            angle = float(np.arccos(np.clip(each.direction @ other.direction, -1.0, 1.0)))
            if angle < max(each.detection.angular_radius, other.detection.angular_radius):
                return True
    return False


def _together(group: Sequence[Sighting]) -> Sighting:
    first = group[0]
    return Sighting(first.camera, first.plane, first.detection, first.position, first.direction, also=tuple(group[1:]))
