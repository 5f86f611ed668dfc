"""Observation planes anywhere: the ground, a table, a shelf, a wall, a ceiling, or a plane through any point.

World frame: any fixed frame of the robot or the room. A plane's frame has z along its normal. Its origin, for the
positions of detections, is the camera's foot point: the point of the plane closest to the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, frozen, numbers_or_nan
from ..errors import GeometryError
from .orientation import Orientation


@dataclass(frozen=True, eq=False)
class Pose:
    """A camera's rotation (3, 3) from camera to world frame, and its position (3,) [m] in the world frame.

    Raises GeometryError if the matrix is not a rotation or a number is not finite.
    """

    rotation: Floats
    position: Floats

    def __post_init__(self) -> None:
        position = numbers_or_nan(self.position)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise GeometryError(f"camera position must be three finite numbers [m], not {self.position}")
        # Orientation checks the rotation; the height does not matter here.
        object.__setattr__(self, "rotation", Orientation(1.0, self.rotation).rotation)
        object.__setattr__(self, "position", frozen(position))

    @classmethod
    def from_hwc(cls, hwc: npt.ArrayLike) -> Pose:
        """From the 4 x 4 transform H_wc ("world from camera"). Raises GeometryError."""
        matrix = numbers_or_nan(hwc)
        if matrix.shape != (4, 4) or not np.allclose(matrix[3], (0.0, 0.0, 0.0, 1.0), atol=1e-6):
            raise GeometryError("Hwc must be 4 x 4 numbers with last row 0, 0, 0, 1; check whether it is transposed")
        return cls(matrix[:3, :3], matrix[:3, 3])


@dataclass(frozen=True)
class Plane:
    """All points p [m] of the world with normal . p = offset. Objects lie on the side that the normal points to.

    name: identifies the plane in sightings. normal: of any length; it is scaled to length 1. offset [m]: distance from
    the world's origin along the normal, if the normal has length 1; otherwise the offset is divided by the normal's
    length, too.

    Raises GeometryError for a normal of length 0 and for numbers that are not finite.
    """

    name: str
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        normal, offset = numbers_or_nan(self.normal), numbers_or_nan(self.offset)
        offset = offset.reshape(()) if offset.size == 1 else offset  # an array of one number is a number
        length = float(np.linalg.norm(normal)) if normal.shape == (3,) else math.nan
        if not (math.isfinite(length) and length > 1e-9 and offset.shape == () and np.isfinite(offset)):
            raise GeometryError(
                f"plane {self.name!r} needs a normal and an offset [m], not {self.normal}, {self.offset}"
            )
        x, y, z = (normal / length).tolist()
        object.__setattr__(self, "normal", (x, y, z))
        object.__setattr__(self, "offset", float(offset) / length)

    @classmethod
    def through(cls, name: str, point: npt.ArrayLike, normal: npt.ArrayLike) -> Plane:
        """The plane through a point [m] of the world, with this normal. Raises GeometryError."""
        place, direction = numbers_or_nan(point), numbers_or_nan(normal)
        if place.shape != (3,) or direction.shape != (3,):
            raise GeometryError(
                f"plane {name!r} needs three numbers for its point and its normal, not {point!r}, {normal!r}"
            )
        x, y, z = direction.tolist()
        return cls(name, (x, y, z), float(place @ direction))

    @classmethod
    def spotlight(cls, name: str, target: npt.ArrayLike, camera: npt.ArrayLike) -> Plane:
        """The plane through the point `target` that faces a camera at the point `camera` [m].

        The target is the point of this plane that is closest to the camera, so it is in the middle of the mesh.

        Raises GeometryError if both are the same point.
        """
        here, there = numbers_or_nan(camera), numbers_or_nan(target)
        if here.shape != (3,) or there.shape != (3,):
            raise GeometryError(
                f"spotlight {name!r} needs three numbers for target and camera, not {target!r}, {camera!r}"
            )
        toward = here - there
        return cls.through(name, target, toward.tolist())

    @cached_property
    def axes(self) -> Floats:
        """Rotation (3, 3) from world to plane frame: its rows are two directions in the plane, and the normal.

        The first direction is the world's x axis projected onto the plane. If the normal is close to that axis, it is
        the world's z axis projected onto the plane.
        """
        normal = np.array(self.normal)
        along = np.eye(3)[0 if abs(self.normal[0]) < 0.99 else 2]
        first = along - (along @ normal) * normal
        first /= np.linalg.norm(first)
        return frozen(np.stack([first, np.cross(normal, first), normal]))

    def seen_from(self, pose: Pose) -> Orientation:
        """The orientation of a camera over this plane. Raises GeometryError if the camera is on or behind the plane."""
        height = float(np.dot(self.normal, pose.position)) - self.offset
        if height <= 0.0:
            raise GeometryError(f"camera is {-height:g} m behind plane {self.name!r}; check the plane's normal")
        return Orientation(height, self.axes @ pose.rotation)

    def to_world(self, points: Floats, pose: Pose) -> Floats:
        """Positions (n, 3) [m] of detections on this plane, seen from a pose, in the world frame."""
        foot = pose.position - (np.dot(self.normal, pose.position) - self.offset) * np.array(self.normal)
        return np.asarray(points @ self.axes + foot)


GROUND = Plane("ground")
"""The plane z = 0 of the world frame."""
