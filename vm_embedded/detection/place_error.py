"""How uncertain the place of a detection on the plane is, from geometry alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from .detection import Detection
from .track_settings import TrackSettings

_LEVEL = 1e-3
"""Smallest sine of the angle between a bearing and the plane: a bearing along the plane never meets it."""


def place_errors(detections: Sequence[Detection], settings: TrackSettings) -> Floats:
    """Covariances (m, 2, 2) [m²] of the places of m detections on the plane, in its frame.

    A detection's place is where its bearing meets the plane at the height of its center. With the distance D from the
    camera to the center, and the angle a of the bearing below the horizon, errors move the place so:

    - An angle e between the true and the measured bearing: by D e across the bearing, and by D e / sin(a) along it.
    - An error g of the camera's height: by g / tan(a) along the bearing.

    The angle e has three independent causes, which are added as squares: the center that the network found is off by a
    share of the angular radius (`center_error`) and by a part of a pixel (`pixel_error`), and the camera's orientation
    is not exact (`pose_error`). With a camera 0.8 m above the ground and the default settings, a ball at 3 m is
    uncertain by 2 cm across the bearing and by 8 cm along it, a ball at 6 m by 3 cm and 29 cm.
    """
    bearings = np.array([each.bearing for each in detections]).reshape(-1, 3)
    distances = np.array([each.distance for each in detections])
    radii = np.array([each.angular_radius for each in detections])
    pixels = np.array([each.radius for each in detections])
    pixel = np.divide(radii, pixels, out=np.zeros_like(radii), where=pixels > 0.0)  # angle of a pixel [rad]
    angle = np.sqrt((settings.center_error * radii) ** 2 + (settings.pixel_error * pixel) ** 2 + settings.pose_error**2)
    sine = np.maximum(-bearings[:, 2], _LEVEL)
    level = np.hypot(bearings[:, 0], bearings[:, 1])
    ahead = bearings[:, :2] / np.maximum(level, 1e-9)[:, None]
    ahead[level < 1e-9] = (1.0, 0.0)  # straight below the camera, both errors are alike
    beside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    along = (distances * angle / sine) ** 2 + (settings.height_error * level / sine) ** 2
    across = (distances * angle) ** 2
    return np.asarray(along[:, None, None] * _squares(ahead) + across[:, None, None] * _squares(beside))


def _squares(directions: Floats) -> Floats:
    """The outer products (m, 2, 2) of unit vectors (m, 2) with themselves."""
    return directions[:, :, None] * directions[:, None, :]
