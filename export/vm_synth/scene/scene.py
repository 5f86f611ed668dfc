"""A scene: camera, ground, the objects to detect, and all objects around them.

World frame: z up [m], the plane is z = 0, the camera is above the origin.
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
from .surface import Surface


@dataclass(frozen=True)
class PlacedBall:
    """A ball in a scene: center (3,) and radius [m], rotation (3, 3) and design."""

    center: Floats
    radius: float
    attitude: Floats
    design: BallDesign


@dataclass(frozen=True)
class PlacedObject:
    """An object that stands on a table or floor: center (3,), radius and height [m] of the cylinder around it."""

    center: Floats
    radius: float
    height: float


@dataclass(frozen=True)
class Scene:
    """Everything that one picture shows.

    size: of the picture (w, h) [px]. field: the soccer field, or None for the floor of the photograph. ball_radius: the
    right radius of balls [m]. ball: the ball to detect, or None. other: a ball of the wrong size or above the plane, or
    None; other_label is its class. mesh: all other objects; names and counts hold the name and the number of vertices
    of each. ground_albedo: linear RGB, for light that the ground reflects. seed: of the ray tracer. surface: the table
    or floor, or None for a field or the floor of the photograph. objects: the objects to detect if they are not the
    ball, the first bodies of the mesh. object_name, object_height: class and right height of such objects [m];
    ball_radius is their right radius.
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
    surface: Surface | None = None
    objects: tuple[PlacedObject, ...] = ()
    object_name: str = ""
    object_height: float = 0.0

    @property
    def camera(self) -> Floats:
        """Position (3,) of the camera [m]."""
        return np.array([0.0, 0.0, self.orientation.height])
