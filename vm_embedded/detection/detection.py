"""One object that was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..arrays import Floats
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
