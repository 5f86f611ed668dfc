"""Proposals for the close look: where an object may be.

They are the peaks of its class, if the network has peaks for it. Otherwise the points' probabilities tell, for all
places at once. A likely place is one that an object would fill with likely points. Its score is the sum of their
probabilities. The place with the highest score comes first; then the best place outside of the first object, and so on.
In the end each place moves to the mean of the points in it, weighted by their probabilities.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Mask, Singles
from .observation import Observation

_MOST_POINTS = 256
"""Largest number of points that are compared in pairs: a frame of noise must not cost a second."""

_WHOLE_AND_CORE = np.array([1.0, 0.9])[:, None, None]
"""Shares of an object's radius. Only points in its core count for its score: those at the outline show both sides."""


def propose(
    observation: Observation, class_name: str, probabilities: Singles, above: float, most: int
) -> tuple[Floats, Floats | None]:
    """Centers (c, 3) of at most `most` places of a class, best first, and their scores (c,), if they are peaks.

    probabilities, above: see `propose_places`, which peaks don't need.
    """
    if class_name not in observation.manifest.peaks:
        return propose_places(observation, probabilities, above, most), None
    peaks, view = observation.find_peaks(class_name, most), observation.view
    return view.shape.center_along(peaks.rays, view.height), peaks.scores


def propose_places(observation: Observation, probabilities: Singles, above: float, most: int) -> Floats:
    """Centers (c, 3) of at most `most` places, best first, from the slots' probabilities (m,) of a class.

    The centers are relative to the camera in the mesh frame [m]. above: probability of a point from which it counts.
    """
    view = observation.view
    likely = np.flatnonzero((probabilities > above) & observation.projected.on_screen)
    if len(likely) > _MOST_POINTS:
        likely = likely[np.argpartition(probabilities[likely], -_MOST_POINTS)[-_MOST_POINTS:]]
    if not len(likely):
        return np.empty((0, 3))
    likely = likely[np.argsort(observation.layout.slots[likely])]  # the same digits for every layout
    rays, p = view.layout.rays[likely], probabilities[likely]
    centers = view.shape.center_along(rays, view.height)
    near, core = view.shape.covers(rays, centers, view.height, _WHOLE_AND_CORE)
    chosen = best_apart(core.astype(np.float32) @ p, near, most)
    # Once only: a second move would lead away to larger things near by, and fewer balls would be found.
    middle = (near[chosen] * p) @ rays
    return view.shape.center_along(middle / np.linalg.norm(middle, axis=1, keepdims=True), view.height)


def best_apart(score: Singles, near: Mask, most: int) -> list[int]:
    """Numbers of at most `most` places by descending score (m,), each above 0; none is near (m, m) a better one."""
    left, chosen = score.copy(), []
    for _ in range(min(most, len(score))):
        best = int(left.argmax())
        if left[best] <= 0.0:
            break
        chosen.append(best)
        left[near[best]] = 0.0
    return chosen
