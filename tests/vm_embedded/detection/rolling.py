"""Simulated balls that roll on the ground, and what a camera above it detects of them, with errors."""

import math
from dataclasses import dataclass

import numpy as np

from tests.vm_embedded.detection.views import observation_of, view_at
from vm_embedded.detection.detection import Detection
from vm_embedded.detection.detections import Detections

HEIGHT, RADIUS = 0.8, 0.1
"""Height of the camera and radius of the ball [m]."""

FOCAL_LENGTH = 400.0
"""Scale of the lens [px]."""

FRICTION = 0.3
"""How fast a rolling ball slows down [m/s²]."""

CLEAN = {"center": 0.05, "pixel": 0.5, "pose": 0.005, "height": 0.01}
"""Errors of a detection: of its center in radii and pixels, of the pose [rad], of the height [m]."""


def detection_at(place, random=None, name="ball", errors=CLEAN):
    """The detection of a ball at a place (2,) [m]. random: draws the errors; None for none."""
    center = np.array([*place, RADIUS - HEIGHT])
    distance = float(np.linalg.norm(center))
    bearing, height, angular = center / distance, HEIGHT, math.asin(RADIUS / distance)
    pixels = FOCAL_LENGTH * angular
    if random is not None:
        spread = math.hypot(errors["center"] * angular, errors["pixel"] / FOCAL_LENGTH)
        bearing = bearing + random.normal(0.0, spread, 3) + np.cross(random.normal(0.0, errors["pose"], 3), bearing)
        bearing /= np.linalg.norm(bearing)
        height += random.normal(0.0, errors["height"])
    distance = (height - RADIUS) / -bearing[2]
    return Detection(
        *(name, 0.9, np.zeros(2), pixels, np.zeros((3, 2)), bearing, distance * bearing + (0.0, 0.0, height)),
        *(distance, angular, distance, True, 30),
    )


def detections_of(objects):
    """The detections of a frame with these objects."""
    return Detections(tuple(objects), (), _NOTHING, 0.5, {"total": 1.0})


_NOTHING = observation_of(view_at())


@dataclass(frozen=True)
class Ball:
    """A ball that is at a place (2,) [m] at time 0, rolls with a velocity (2,) [m/s], and slows down."""

    start: np.ndarray
    velocity: np.ndarray

    def place(self, time):
        """Where it is at a time [s]."""
        speed = float(np.linalg.norm(self.velocity))
        rolled = min(time, speed / FRICTION)
        return self.start + (rolled - 0.5 * FRICTION * rolled**2 / max(speed, 1e-9)) * self.velocity

    def velocity_at(self, time):
        """Its velocity (2,) at a time [s]."""
        speed = float(np.linalg.norm(self.velocity))
        return max(0.0, 1.0 - FRICTION * time / max(speed, 1e-9)) * self.velocity


def any_ball(random):
    """A ball somewhere from 1 to 4 m ahead that rolls anywhere with 0.3 to 2 m/s."""
    distance, bearing = random.uniform(1.0, 4.0), random.uniform(-0.8, 0.8)
    speed, heading = random.uniform(0.3, 2.0), random.uniform(-math.pi, math.pi)
    return Ball(
        distance * np.array([math.cos(bearing), math.sin(bearing)]),
        speed * np.array([math.cos(heading), math.sin(heading)]),
    )
