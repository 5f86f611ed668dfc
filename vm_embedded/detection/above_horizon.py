"""How far above the horizon the picture looks like the field.

No part of the plane is above the horizon. If the picture there has the colors of the field, row after row, then the
camera looks farther down than its pose says, by at least the angle of these rows.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Image
from .observation import Observation

_ROWS = np.radians([2.0, 4.0, 6.0, 9.0, 13.0, 18.0, 24.0, 31.0])
"""Angles above the horizon that are looked at [rad]."""

_COLUMNS = np.radians(np.arange(-78.0, 79.0, 6.0))

_RAYS = np.stack(
    [
        np.outer(np.cos(_ROWS), np.cos(_COLUMNS)).ravel(),
        np.outer(np.cos(_ROWS), np.sin(_COLUMNS)).ravel(),
        np.repeat(np.sin(_ROWS), len(_COLUMNS)),
    ],
    axis=1,
)

_FEWEST, _MOST = 40, 240
"""Points of the field that show its colors: fewer say nothing, and more than this are not needed."""

_CERTAIN = 0.6
"""Probability from which a point shows the field."""

_NEAR = 3.0
"""Colors up to so many standard deviations from the field's mean are like it."""

_ROUGH = 5.0
"""Standard deviation of a color that is added to the field's [levels]."""

_LEVEL = 2
"""Halvings of the picture that is looked at."""


def field_above_horizon(observation: Observation, column: int) -> float | None:
    """The angle above the horizon [rad] up to which at least half of the picture looks like the field; 0 if it does not
    right above the horizon. None if the picture does not show the field or what is above the horizon.

    column: of the class field in the answers.
    """
    view = observation.view
    points = np.flatnonzero(observation.probabilities[:, column] > _CERTAIN)
    if len(points) < _FEWEST:
        return None
    picture = observation.pyramid.level(_LEVEL)
    colors = _colors(picture, observation.pixels[points[:: -(-len(points) // _MOST)]])
    pixels = view.ray_pixels(_RAYS)
    shown = view.in_picture(pixels)
    counts = shown.reshape(len(_ROWS), -1).sum(axis=1)
    if counts[0] < 5:
        return None
    middle = np.median(colors, axis=0)
    away = colors - middle
    away = away[np.abs(away).sum(axis=1) <= 3.0 * np.median(np.abs(away).sum(axis=1)) + _ROUGH]  # without lines
    spread = away.T @ away / len(away) + _ROUGH**2 * np.eye(away.shape[1])
    off = _colors(picture, pixels[shown]) - middle
    alike = np.zeros(len(_RAYS), dtype=bool)
    alike[shown] = (off @ np.linalg.inv(spread) * off).sum(axis=1) < _NEAR**2
    full = 2 * alike.reshape(len(_ROWS), -1).sum(axis=1) > counts
    rows = int(np.argmin([*full, False]))  # up to the first row that is something else
    return float(_ROWS[rows - 1]) if rows else 0.0


def _colors(picture: Image, pixels: Floats) -> Floats:
    """Colors (n, channels) of the halved picture at pixels (n, 2) of the frame."""
    x, y = (pixels / 2**_LEVEL).astype(np.intp).T
    height, width = picture.shape[:2]
    found = picture[np.minimum(y, height - 1), np.minimum(x, width - 1)]
    return np.asarray(found.reshape(len(x), -1), dtype=np.float64)
