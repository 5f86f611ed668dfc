"""A track: one object over several frames."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..arrays import Floats
from ..borders.records import SIZE, Record, Sent


@dataclass(frozen=True, eq=False)
class Track(Record):
    """One object over several frames, at the time of its last detection. The frame is that of Detection.

    id: its number, from 1; a Tracker uses each number once. class_name: name of its class. time [s]: of its last
    detection. position (3,) [m]: of its center, smoothed. velocity (2,) [m/s]: on the plane. covariance (4, 4): of x, y
    and the velocity. count: number of its detections.
    """

    id: Annotated[int, Sent(least=1)]
    class_name: str
    time: float
    position: Annotated[Floats, Sent(3, (3,))]
    velocity: Annotated[Floats, Sent(3, (2,))]
    covariance: Floats
    count: int

    def __repr__(self) -> str:
        (x, y, _), (vx, vy) = self.position, self.velocity
        return f"<track {self.id} {self.class_name} at ({x:.2f}, {y:.2f}) m, ({vx:.2f}, {vy:.2f}) m/s>"

    @property
    def position_error(self) -> Annotated[float, SIZE]:
        """Standard deviation of the position in the direction in which it is largest [m]."""
        return _largest(self.covariance[:2, :2])

    @property
    def velocity_error(self) -> Annotated[float, SIZE]:
        """Standard deviation of the velocity in the direction in which it is largest [m/s]."""
        return _largest(self.covariance[2:, 2:])

    def position_at(self, time: float) -> Floats:
        """Where the object is (3,) [m] at another time [s], if its velocity stays the same."""
        return self.position + (time - self.time) * np.append(self.velocity, 0.0)


def _largest(covariance: Floats) -> float:
    """The largest standard deviation of a covariance (2, 2)."""
    a, b, d = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    return math.sqrt(0.5 * (a + d) + math.hypot(0.5 * (a - d), b))
