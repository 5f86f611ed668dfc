"""The threshold that decides what is an object: what another value would change in a frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from ..detection.detections import Detections
from ..detection.detector import Detector
from ..detection.objects import locate
from ..detection.observation import Stopwatch
from ..detection.settings import Settings
from ..errors import InputError

_WORTH_SHOWING = 0.05
"""Least confidence of a rejected candidate that is shown: most candidates are far from any threshold."""


def threshold_name(detector: Detector) -> str:
    """The setting that decides: min_confidence with a close look, threshold without."""
    return "threshold" if detector.look is None else "min_confidence"


def with_threshold(detector: Detector, text: str) -> Settings:
    """The detector's settings with another value of its threshold. Raises InputError."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1.0:
        raise InputError(f"the threshold must be a number from 0 to 1, not {text[:20]!r}")
    changed: dict[str, Any] = {threshold_name(detector): value}
    return replace(detector.settings, **changed)


def with_settings(detector: Detector, detections: Detections, settings: Settings) -> Detections:
    """What the frame of `detections` shows with other thresholds, with the rejected candidates that are not hopeless.

    Its network does not run again. Use it in the thread of the detector. Raises ModelError if the close look does not
    run.
    """
    found, rejected = locate(detections.observation, detector.look, settings, Stopwatch(), explain=True)
    near = tuple(each for each in rejected if each.confidence >= _WORTH_SHOWING)
    return replace(detections, objects=found, rejected=near, threshold=settings.threshold)
