"""One detector, several cameras and several planes: detections of the same object become one sighting."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import AnyImage, Floats
from ..errors import GeometryError, InputError
from ..geometry.lens import Lens
from ..geometry.planes import GROUND, Plane, Pose
from .detection import Detection
from .detector import Detector
from .objects import locate
from .observation import Stopwatch


@dataclass(frozen=True, eq=False)
class CameraView:
    """A camera's picture, its lens and its pose.

    image: uint8, in the detector's pixel format, as for `Detector.detect`. lens: of the camera. pose: of the camera in
    the world frame.
    """

    image: AnyImage | None
    lens: Lens
    pose: Pose


@dataclass(frozen=True, eq=False)
class Sighting:
    """An object in the world frame.

    plane: name of its plane, the one with the largest sum of confidences (`detect_views`). detection: the most
    confident detection on this plane, in the plane's frame. camera: name of the camera of this detection. position (3,)
    [m]: center of the object. direction (3,): unit vector from this camera. also: further detections of the same
    object, those on the same plane first.
    """

    camera: str
    plane: str
    detection: Detection
    position: Floats
    direction: Floats
    also: tuple[Sighting, ...] = ()


def detect_views(
    detector: Detector, views: Mapping[str, CameraView], planes: Sequence[Plane] = (GROUND,)
) -> tuple[Sighting, ...]:
    """Find objects on several planes with several cameras; the most confident object comes first.

    views: the picture, lens and pose of each camera, by its name. planes: the planes to search.

    All cameras share the detector's network and meshes. Two detections of one class are one object in two cases:
    - the cameras differ, the plane is the same, and the detections lie less than a diameter apart;
    - the camera is the same, the planes differ, and the angle between the detections' directions is less than the
      larger of their angular radii.

    The detections nearest to each other, relative to these limits, are joined first. Joining is transitive: two
    detections may also become one object through a third. An object has at most one detection of each camera on each
    plane. In the second case, only one plane can be right. For each plane, the confidences of all its detections of
    this object, from all cameras, are added. The largest sum wins. A camera behind a plane, or too near it for the
    mesh, sees nothing on it.

    Raises InputError for no planes, planes with equal names, or a picture that does not fit.
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
    joined = [_join(group) for group in _groups(found, 2.0 * detector.shape.radius)]
    return tuple(sorted(joined, key=lambda each: -each.detection.confidence))


def _sightings(detector: Detector, camera: str, view: CameraView, plane: Plane) -> Iterator[Sighting]:
    """What one camera sees on one plane; nothing if it is behind the plane or too near it."""
    try:
        orientation = plane.seen_from(view.pose)
        detector.cache.mesh_height(orientation.height)  # raises if the camera is too low
    except GeometryError:
        return
    observation = detector.observe(view.image, orientation, view.lens)
    # Not detector.locate, which would also search for features of the field.
    for each in locate(observation, detector.look, detector.settings, Stopwatch())[0]:
        position = plane.to_world(each.position[None], view.pose)[0]
        away = position - view.pose.position
        yield Sighting(camera, plane.name, each, position, away / np.linalg.norm(away))


def _groups(found: Sequence[Sighting], diameter: float) -> list[list[Sighting]]:
    """The sightings, grouped by object: the nearest pairs, as `_apart` measures, are joined first."""
    pairs = []
    for i, one in enumerate(found):
        for j, other in enumerate(found[:i]):
            apart = _apart(one, other, diameter)
            if apart < 1.0:
                pairs.append((apart, i, j))
    group_of = list(range(len(found)))
    members = {each: [each] for each in group_of}
    for _, i, j in sorted(pairs):
        kept, merged = group_of[i], group_of[j]
        if kept == merged:
            continue
        seen = [(found[each].camera, found[each].plane) for each in members[kept] + members[merged]]
        if len(set(seen)) == len(seen):  # at most one of each camera on each plane
            for each in members[merged]:
                group_of[each] = kept
            members[kept] += members.pop(merged)
    return [[found[each] for each in group] for group in sorted(members.values(), key=min)]


def _apart(one: Sighting, other: Sighting, diameter: float) -> float:
    """Distance of two sightings, in units of the limit below which they are one object; infinite if they can't
    be one."""
    if one.detection.class_name != other.detection.class_name:
        return math.inf
    if one.camera != other.camera and one.plane == other.plane:
        return float(np.linalg.norm(one.position - other.position)) / diameter
    if one.camera == other.camera and one.plane != other.plane:
        angle = math.acos(min(max(float(one.direction @ other.direction), -1.0), 1.0))
        return angle / max(one.detection.angular_radius, other.detection.angular_radius)
    return math.inf


def _join(group: Sequence[Sighting]) -> Sighting:
    """Join sightings of one object: the most confident one on the plane with the largest sum of confidences stays."""
    sums: dict[str, float] = {}
    for each in group:
        sums[each.plane] = sums.get(each.plane, 0.0) + each.detection.confidence
    ordered = sorted(group, key=lambda each: (-sums[each.plane], -each.detection.confidence))
    return replace(ordered[0], also=tuple(ordered[1:]))
