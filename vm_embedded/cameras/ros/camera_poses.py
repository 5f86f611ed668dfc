"""The poses of a camera over the observation plane, from the transforms of tf."""

from __future__ import annotations

import math

from ...geometry.orientation import OPTICAL_TO_CAMERA, Orientation
from .transforms import Transform, TransformTree


def orientation_of(transform: Transform, optical: bool = True) -> Orientation:
    """The orientation of a camera, from the transform of its frame into the plane's.

    optical: its frame has optical axes (x right, y down, z forward). Raises GeometryError if it is not above the plane.
    """
    rotation = transform.rotation @ OPTICAL_TO_CAMERA.T if optical else transform.rotation
    return Orientation(float(transform.translation[2]), rotation)


def newest_pose(
    tree: TransformTree, plane: str, camera: str, after: float, frame_time: float
) -> tuple[float, Orientation] | None:
    """The newest pose that tf knows and its time [s], or None if it is not later than `after`.

    A camera that is fixed to the plane has this pose at all times, also at `frame_time`. Raises InputError if tf does
    not connect the frames, and GeometryError if the camera is not above the plane.
    """
    time = tree.newest(plane, camera)
    if math.isinf(time):
        time = frame_time
    if time <= after:
        return None
    return time, orientation_of(tree.at(plane, camera, time))
