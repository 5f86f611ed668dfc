"""The camera's pose over the observation plane: height, roll, pitch and yaw.

Frames: the camera's x points along the optical axis, y left and z up. The observation plane is z = 0 of its frame,
with z up. `H_oc` ("o from c") maps camera coordinates to plane coordinates. Only this module converts from the optical
frame of OpenCV and ROS (x right, y down, z forward).

The paper's mesh needs the height and the orientation of the camera (section "Visual Mesh Geometry"). It follows the
plane, so a network handles turns of the camera better (section "Discussion and Conclusion").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, frozen, numbers_or_nan, one_number
from ..errors import GeometryError

OPTICAL_TO_CAMERA: Floats = frozen(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))
"""Rotation from an optical frame (x right, y down, z forward) to the camera frame (x forward, y left, z up)."""


def rotation_z(angle: float) -> Floats:
    """Rotation (3, 3) by `angle` [rad] around z."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_quaternion(quaternion: npt.ArrayLike) -> Floats:
    """Rotation (3, 3) of a quaternion (w, x, y, z). Raises GeometryError if its length differs from 1 by over 1e-3."""
    q = numbers_or_nan(quaternion)
    if q.shape != (4,) or not np.isfinite(q).all() or abs(float(q @ q) - 1.0) > 2e-3:
        raise GeometryError(f"quaternion must be (w, x, y, z) of length 1, not {quaternion!r}")
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: Floats) -> tuple[float, float, float, float]:
    """The quaternion (w, x, y, z) of a rotation (3, 3), with w >= 0."""
    # Each product of two components is a sum of entries of the rotation; the largest square gives the best precision.
    r, trace = rotation, float(np.trace(rotation))
    squares = [1.0 + trace, *(1.0 - trace + 2.0 * r[i, i] for i in range(3))]
    products = np.array(
        [
            [squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]],
        ]
    )
    row = products[int(np.argmax(squares))]
    w, x, y, z = row / math.copysign(float(np.linalg.norm(row)), row[0])
    return float(w), float(x), float(y), float(z)


@dataclass(frozen=True, eq=False)
class Orientation:
    """Height and rotation of a camera over the observation plane.

    height [m]: of the camera over the plane. rotation (3, 3): from the camera's frame to the plane's frame.

    Raises GeometryError if the height is not above 0 and finite or the matrix is not a rotation, and InputError if the
    height is not a number. An array of one number is a number.
    """

    height: float
    rotation: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "height", one_number(self.height, "height"))
        rotation = numbers_or_nan(self.rotation)
        if not math.isfinite(self.height) or self.height <= 0:
            raise GeometryError(f"camera height must be a number above 0 m, not {self.height}")
        if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
            raise GeometryError("camera rotation must be 3 x 3 finite numbers; check it for NaN and infinity")
        with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no rotation anyway
            error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
            mirrors = bool(np.linalg.det(rotation) < 0)
        if not error <= 1e-3 or mirrors:
            mirrored = ", and R mirrors" if mirrors else ""
            raise GeometryError(
                f"camera rotation R must be a rotation, but R R^T differs from the identity by {error:.2g}{mirrored}"
            )
        object.__setattr__(self, "rotation", frozen(rotation))

    @classmethod
    def from_hoc(cls, hoc: npt.ArrayLike) -> Orientation:
        """From the 4 x 4 transform H_oc, of which only the rotation and the height [m] in row 2, column 3 are used.

        Raises GeometryError if it is not 4 x 4 numbers.
        """
        matrix = numbers_or_nan(hoc)
        if matrix.shape != (4, 4):
            raise GeometryError(f"Hoc must be 4 x 4 numbers, not {str(hoc)[:60]}")
        return cls(float(matrix[2, 3]), matrix[:3, :3])

    @classmethod
    def from_roll_pitch(cls, height: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Orientation:
        """From angles [rad], R = Rz(yaw) Ry(pitch) Rx(roll).

        roll > 0 tilts to the right, pitch > 0 looks down, yaw > 0 turns to the left.

        Raises GeometryError for a roll or pitch beyond a full turn, which is probably in degrees, and for angles that
        are not finite, and InputError for what is not a number.
        """
        roll, pitch, yaw = (one_number(*each) for each in ((roll, "roll"), (pitch, "pitch"), (yaw, "yaw")))
        for name, angle in (("roll", roll), ("pitch", pitch)):
            if math.isfinite(angle) and abs(angle) > math.tau:
                raise GeometryError(
                    f"{name} of {angle:g} rad is more than a full turn; did you mean {angle:g} degrees, "
                    f"{name}=math.radians({angle:g})?"
                )
        if not (math.isfinite(roll) and math.isfinite(pitch) and math.isfinite(yaw)):
            raise GeometryError(f"roll, pitch and yaw must be finite numbers, not {roll}, {pitch} and {yaw}")
        cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
        tilt = np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
        return cls(height, rotation_z(yaw) @ tilt)

    @classmethod
    def from_quaternion(cls, height: float, quaternion: npt.ArrayLike, optical: bool = False) -> Orientation:
        """From a quaternion (w, x, y, z) of the rotation from camera to plane.

        optical: the quaternion rotates from the optical frame of OpenCV and ROS instead of the camera frame.

        Raises GeometryError if its length differs from 1 by more than 1e-3.
        """
        rotation = rotation_from_quaternion(quaternion)
        return cls(height, rotation @ OPTICAL_TO_CAMERA.T if optical else rotation)

    def adjusted(self, pitch: float, roll: float, scale: float) -> Orientation:
        """This orientation with angles added [rad], and with the height times `scale`. The yaw stays.

        Raises GeometryError for numbers that are not finite, and for a scale that is not above 0.
        """
        return Orientation.from_roll_pitch(self.height * scale, self.roll + roll, self.pitch + pitch, self.yaw)

    @cached_property
    def yaw(self) -> float:
        """Angle of the optical axis around the vertical [rad].

        If the camera looks straight down, it is the angle of the picture's upward direction.
        """
        r = self.rotation
        if math.hypot(r[0, 0], r[1, 0]) > 1e-9:
            return math.atan2(r[1, 0], r[0, 0])
        return math.atan2(-r[0, 1], r[1, 1])

    @cached_property
    def level(self) -> Floats:
        """The rotation (3, 3) without its yaw: Ry(pitch) Rx(roll)."""
        return frozen(rotation_z(-self.yaw) @ self.rotation)

    @property
    def pitch(self) -> float:
        """Angle of the optical axis below the horizon [rad]."""
        return math.atan2(-self.level[2, 0], self.level[0, 0])

    @property
    def roll(self) -> float:
        """Tilt to the right [rad]."""
        return math.atan2(-self.level[1, 2], self.level[1, 1])
