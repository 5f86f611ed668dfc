"""Goal posts and robots, at the peaks of their classes: each is where it stands on the plane.

A close look at objects serves here, too. The object is a circle on the plane, around the base of the upright. So a
patch shows the base in its middle, the ground around it, and the lower part of the upright.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..field.features import UPRIGHTS, Upright
from .looking import Judgment
from .peaks import first_apart
from .prepared_view import PreparedView

_SAME = 0.12
"""Two bases nearer to each other than this share of their distance are those of one thing: far away, a small error in
the picture is a large one on the plane."""


def uprights_at(class_name: str, view: PreparedView, judged: Sequence[Judgment]) -> tuple[Upright, ...]:
    """The uprights of a class that were judged to be there, nearest first. view: see `around_bases`."""
    judged = [each for each in judged if each.reason is None]
    centers = np.array([each.center for each in judged]).reshape(-1, 3) @ view.heading.T
    widths = [2.0 * view.shape.radius * each.scale for each in judged]
    pixels = view.picture_pixels(centers[:, :2])
    found = []
    for center, width, pixel, each in zip(centers, widths, pixels, judged, strict=True):
        distance = float(np.linalg.norm(center))
        found.append(
            Upright(UPRIGHTS[class_name], each.confidence, center[:2], distance, center / distance, pixel, width)
        )
    return apart(found) if len(found) > 1 else tuple(found)


def apart(uprights: Sequence[Upright]) -> tuple[Upright, ...]:
    """Uprights without those that are there already, nearest first. uprights: most probable first."""
    places = np.array([each.position for each in uprights]).reshape(-1, 2)
    ranges = np.hypot(*places.T)
    reach = np.maximum(_SAME * ranges, 0.5 * np.array([each.width for each in uprights]))
    kept = first_apart(np.hypot(*(places[:, None] - places).T) < reach[:, None])
    return tuple(uprights[number] for number in kept[np.argsort(ranges[kept], kind="stable")])
