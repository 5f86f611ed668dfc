"""What a picture shows: camera, ground, ball and all things around.

World frame: the plane is z = 0, z up, the camera stands over the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import RadialLens

from ..balls.design import BallDesign
from ..bodies.solids import JoinedBodies
from .field import Field
from .sensor import Sensor


@dataclass(frozen=True)
class PlacedBall:
    """A sphere: center (3,) and radius [m], attitude (3, 3), looks."""

    center: Floats
    radius: float
    attitude: Floats
    design: BallDesign


@dataclass(frozen=True)
class Scene:
    """Everything that one picture shows.

    field: the soccer field, or None where the ball lies on the floor of the photograph. ball: the one to be found,
    or None where there is none of the radius that balls have here.
    other: a ball that is not, because it is of another size or off the plane; other_label says what it counts as.
    mesh: all other things, by names, each of so many vertices as counts says. ground_albedo (3,) is what the ground
    throws back at them. seed: of the paths of light.
    """

    lens: RadialLens
    size: Size
    orientation: Orientation
    field: Field | None
    ball_radius: float
    ball: PlacedBall | None
    other: PlacedBall | None
    other_label: str
    names: tuple[str, ...]
    counts: tuple[int, ...]
    mesh: JoinedBodies
    ground_albedo: tuple[float, float, float]
    sensor: Sensor
    seed: int

    @property
    def camera(self) -> Floats:
        """Where the camera is (3,) [m]."""
        return np.array([0.0, 0.0, self.orientation.height])
