"""One object that was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ..arrays import Floats
from ..borders.records import SHARE, SIZE, Record, Sent
from .track import Track


@dataclass(frozen=True, eq=False)
class Detection(Record):
    """One object on the observation plane, or, with a `reason`, a rejected candidate.

    The coordinates are in the plane's frame. Its origin is on the plane below the camera, and z points up. This is the
    frame that the orientation maps to: the x axis is the direction of yaw 0. Without a yaw, x points where the camera
    looks.

    class_name: name of its class. confidence: 0 to 1; with a close look its calibrated probability, otherwise the mean
    probability of the points inside its outline. center (2,) [px]: centroid of its outline. radius [px]: of a disk with
    the same area as its outline. outline (m, 2) [px]: the part that the lens sees. bearing (3,): unit vector from the
    camera to its center. position (3,) [m]: of its center, where the bearing reaches the height of an object's center.
    distance [m]: from the camera to this center. angular_radius [rad]: angle from its center to its outline, measured
    by the close look, or else by the points. distance_by_angle [m]: distance that follows from `angular_radius` and the
    real radius. distances_agree: whether the apparent size is near the size expected at `distance`, within 20 % with a
    close look, otherwise within one ring spacing of the mesh. points: number of mesh points inside its outline. reason:
    why a candidate was rejected; an object has none. track: the object over several frames, if a Tracker follows it.
    """

    class_name: Annotated[str, Sent(name="class")]
    confidence: Annotated[float, SHARE]
    center: Annotated[Floats, Sent(1, (2,))]
    radius: Annotated[float, Sent(1, least=0)]
    outline: Floats
    bearing: Annotated[Floats, Sent(5, (3,))]
    position: Annotated[Floats, Sent(3, (3,))]
    distance: Annotated[float, SIZE]
    angular_radius: Annotated[float, Sent(5, least=0)]
    distance_by_angle: Annotated[float, SIZE]
    distances_agree: Annotated[bool, Sent()]
    points: Annotated[int, SIZE]
    reason: Annotated[str | None, Sent()] = None
    track: Annotated[Track | None, Sent()] = None

    def __repr__(self) -> str:
        x, y, z = self.position
        reason = "" if self.reason is None else f" rejected: {self.reason}"
        place = f"{self.distance:.2f} m at ({x:.2f}, {y:.2f}, {z:.2f})"
        return f"<{self.class_name} {self.confidence:.2f} {place}{reason}>"
