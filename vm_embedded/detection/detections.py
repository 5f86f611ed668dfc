"""Results of a frame: the objects and the points behind them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, Singles
from ..field.features import FieldFeatures
from ..network.manifest import Manifest
from .observation import Observation
from .track import Track


@dataclass(frozen=True, eq=False)
class Detection:
    """One object on the observation plane, or, with a `reason`, a rejected candidate.

    The coordinates are in the plane's frame. Its origin is on the plane below the camera, and z points up. This is the
    frame that the orientation maps to: the x axis is the direction of yaw 0. Without a yaw, x points where the camera
    looks.

    class_name: name of its class. confidence: 0 to 1; with a close look its calibrated probability, otherwise the mean
    probability of the points inside its outline. center (2,) [px]: centroid of its outline. radius [px]: of a disk with
    the same area as its outline. outline (m, 2) [px]: the part that the lens sees. bearing (3,): unit vector from the
    camera to its center. position (3,) [m]: its center: where the bearing meets the plane that is parallel to the
    observation plane, at the height of the object's center. distance [m]: from the camera to this center.
    angular_radius [rad]: angle from its center to its outline. With a close look, it follows from the size that the
    close look saw; without one, from the size that fits the points best. distance_by_angle [m]: distance that follows
    from `angular_radius` and the real radius. distances_agree: whether the apparent size is near the size expected at
    `distance`, within 20 % with a close look, otherwise within one ring spacing of the mesh. points: number of mesh
    points inside its outline. reason: why it was rejected, or None. track: of the object over several frames, if a
    Tracker follows it.
    """

    class_name: str
    confidence: float
    center: Floats
    radius: float
    outline: Floats
    bearing: Floats
    position: Floats
    distance: float
    angular_radius: float
    distance_by_angle: float
    distances_agree: bool
    points: int
    reason: str | None = None
    track: Track | None = None

    def __repr__(self) -> str:
        x, y, z = self.position
        reason = "" if self.reason is None else f" rejected: {self.reason}"
        place = f"{self.distance:.2f} m at ({x:.2f}, {y:.2f}, {z:.2f})"
        return f"<{self.class_name} {self.confidence:.2f} {place}{reason}>"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON: pixels to 0.1, meters to 0.001."""
        data: dict[str, Any] = {
            "class": self.class_name,
            "confidence": round(self.confidence, 3),
            "center": [round(float(value), 1) for value in self.center],
            "radius": round(self.radius, 1),
            "bearing": [round(float(value), 5) for value in self.bearing],
            "position": [round(float(value), 3) for value in self.position],
            "distance": round(self.distance, 3),
            "angular_radius": round(self.angular_radius, 5),
            "distance_by_angle": round(self.distance_by_angle, 3),
            "distances_agree": self.distances_agree,
            "points": self.points,
        }
        if self.reason is not None:
            data["reason"] = self.reason
        if self.track is not None:
            data["track"] = self.track.as_dict()
        return data


@dataclass(frozen=True, eq=False)
class ClassPoints:
    """The m points of a class.

    class_name: name of the class. bearings (m, 3): unit vectors from the camera, in the plane's frame. pixels (m, 2)
    [px]: where the points are in the image. probabilities (m,): of the class, above the threshold.
    """

    class_name: str
    bearings: Floats
    pixels: Floats
    probabilities: Singles

    def __len__(self) -> int:
        return len(self.bearings)


@dataclass(frozen=True, eq=False)
class Detections:
    """The objects of a frame, most confident first, and the n mesh points on screen.

    objects: the accepted objects. rejected: the rejected candidates, each with its reason; empty unless `explain` was
    set. observation: the points. threshold: a point belongs to a class if its probability is above this. timing_ms:
    time of each stage [ms]. field: goal posts, robots, lines and border of the field; None for a network without these
    classes.
    """

    objects: tuple[Detection, ...]
    rejected: tuple[Detection, ...]
    observation: Observation
    threshold: float
    timing_ms: dict[str, float]
    field: FieldFeatures | None = None

    def __len__(self) -> int:
        return len(self.objects)

    def __iter__(self) -> Iterator[Detection]:
        return iter(self.objects)

    def __getitem__(self, index: int) -> Detection:
        return self.objects[index]

    def __repr__(self) -> str:
        return f"<{len(self.objects)} detections, {len(self.pixels)} points: {list(self.objects)}>"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, with the fields of a line of vm-detect: points, detections, field, timing_ms [ms].

        `field` is missing for a network without classes of the field.
        """
        data: dict[str, Any] = {
            "points": len(self.pixels),
            "detections": [each.as_dict() for each in self],
        }
        if self.field is not None:
            data["field"] = self.field.as_dict()
        data["timing_ms"] = {stage: round(value, 3) for stage, value in self.timing_ms.items()}
        return data

    @property
    def manifest(self) -> Manifest:
        """What the model file says about the network."""
        return self.observation.manifest

    @property
    def pixels(self) -> Floats:
        """Pixels (n, 2) of the points."""
        return self.observation.pixels

    @property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) from the camera to the points, in the plane's frame, as in Detection."""
        return self.observation.rays

    @property
    def probabilities(self) -> Singles:
        """Probabilities (n, C) of the points, in the order of the manifest's classes."""
        return self.observation.probabilities

    def points_of(self, class_name: str) -> ClassPoints:
        """The points of a class with a probability above the threshold. Raises InputError for an unknown class."""
        column = self.probabilities[:, self.manifest.column(class_name)]
        chosen = np.flatnonzero(column > self.threshold)
        return ClassPoints(class_name, self.rays[chosen], self.pixels[chosen], column[chosen])
