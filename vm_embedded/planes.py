"""Observation planes anywhere: a table, a shelf, a wall, a ceiling, or a spotlight on a point; not only the ground.

World frame: any fixed frame of the robot or the room. A plane's own frame has z along its normal; the frame that
detections are in stands at the foot of the camera's perpendicular on the plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from .arrays import Floats, frozen
from .errors import GeometryError
from .orientation import Orientation
from .shape import tangents


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a camera is: rotation (3, 3) from camera to world frame, and position (3,) [m] in the world frame.

    Raises GeometryError if the matrix is no rotation or a number is not finite.
    """

    rotation: Floats
    position: Floats

    def __post_init__(self) -> None:
        position = np.array(self.position, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise GeometryError(f"a camera's position must be three finite numbers [m], not {self.position}")
        # An orientation's own checks of a rotation; its height does not matter here.
        object.__setattr__(self, "rotation", Orientation(1.0, self.rotation).rotation)
        object.__setattr__(self, "position", frozen(position))

    @classmethod
    def from_hwc(cls, hwc: npt.ArrayLike) -> Pose:
        """From the 4 x 4 transform H_wc ("world from camera"). Raises GeometryError."""
        try:
            matrix = np.asarray(hwc, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise GeometryError(f"Hwc must be 4 x 4 numbers: {error}") from error
        if matrix.shape != (4, 4):
            raise GeometryError(f"Hwc must be 4 x 4 numbers, not of shape {matrix.shape}")
        return cls(matrix[:3, :3], matrix[:3, 3])


@dataclass(frozen=True)
class Plane:
    """All points p [m] of the world with normal . p = offset; objects lie on the side that the normal points to.

    name: what sightings on it are called after. The normal is brought to length 1, and the offset with it. Raises
    GeometryError for a normal without direction.
    """

    name: str
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        try:
            normal = np.array(self.normal, dtype=np.float64)
            offset = float(self.offset)
        except (TypeError, ValueError) as error:
            raise GeometryError(f"plane {self.name!r} needs three numbers and one: {error}") from error
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else math.nan
        if not (math.isfinite(length) and length > 1e-9 and math.isfinite(offset)):
            raise GeometryError(f"plane {self.name!r} needs a direction and an offset [m], not {self.normal}, {offset}")
        x, y, z = (normal / length).tolist()
        object.__setattr__(self, "normal", (x, y, z))
        object.__setattr__(self, "offset", offset / length)

    @classmethod
    def through(cls, name: str, point: Sequence[float], normal: Sequence[float]) -> Plane:
        """The plane through a point [m] of the world. Raises GeometryError."""
        x, y, z = (float(each) for each in normal)
        return cls(name, (x, y, z), float(np.dot((x, y, z), np.asarray(point, dtype=np.float64))))

    @classmethod
    def spotlight(cls, name: str, target: Sequence[float], camera: Sequence[float]) -> Plane:
        """The plane through `target` that faces a camera at `camera` [m]: the mesh's middle lies on the target, and
        objects are as dense in points there as the mesh makes them below a camera. Raises GeometryError if both are one
        point."""
        toward = np.asarray(camera, dtype=np.float64) - np.asarray(target, dtype=np.float64)
        return cls.through(name, target, toward.tolist())

    @cached_property
    def axes(self) -> Floats:
        """World to plane frame (3, 3): its rows are two directions in the plane, and the normal.

        A plane as level as the ground has the world's own x and y.
        """
        normal = np.array(self.normal)
        if self.normal[2] > 1.0 - 1e-12:
            return frozen(np.eye(3))
        first, second = tangents(normal)
        return frozen(np.stack([first, second, normal]))

    def seen_from(self, pose: Pose) -> Orientation:
        """The orientation of a camera over this plane. Raises GeometryError if the camera is not before the plane."""
        height = float(np.dot(self.normal, pose.position)) - self.offset
        if height <= 0.0:
            raise GeometryError(f"the camera is {-height:g} m behind plane {self.name!r}; is its normal the wrong way?")
        return Orientation(height, self.axes @ pose.rotation)

    def to_world(self, points: Floats, pose: Pose) -> Floats:
        """Points (n, 3) [m] of detections on this plane, seen from a pose, in the world frame."""
        foot = pose.position - (np.dot(self.normal, pose.position) - self.offset) * np.array(self.normal)
        return np.asarray(points @ self.axes + foot)


GROUND = Plane("ground")
"""The world's z = 0."""
