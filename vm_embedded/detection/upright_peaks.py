"""Goal posts and robots from peaks: the place of a peak is the base, and nobody looks again."""

from __future__ import annotations

import numpy as np

from ..field.uprights import Base, apart
from .observation import Observation
from .settings import Settings


def peak_bases(observation: Observation, class_name: str, settings: Settings) -> list[Base]:
    """The uprights of a class that the network has peaks for, nearest first.

    settings: `min_confidence` and `max_proposals` count.
    """
    view, peaks = observation.view, observation.find_peaks(class_name, settings.max_proposals)
    found = peaks.part((peaks.probabilities >= settings.min_confidence) & (peaks.rays[:, 2] < 0.0))
    rays = found.rays @ view.heading.T
    positions = rays[:, :2] * (view.height / np.maximum(-rays[:, 2:], 1e-6))
    widths = 2.0 * observation.manifest.radius * np.exp(found.log_sizes)
    rows = zip(positions, widths.tolist(), found.probabilities.tolist(), strict=True)
    return apart([Base(*each) for each in rows])
