"""A crop: a box of an image that a person judges."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from vm_embedded.output.box_files import Shares

_MOST_DOUBTFUL = 0.5
"""Confidences near this come first. Those of a close look are calibrated probabilities."""


@dataclass(frozen=True)
class Crop:
    """A box to judge.

    image: path relative to the folder of boxes. shares: center x and y, width and height, as shares of the image.
    confidence: 0 to 1; None if unknown.
    """

    image: str
    class_name: str
    shares: Shares
    confidence: float | None

    @cached_property
    def id(self) -> str:
        """Sixteen hexadecimal digits. Another box, class or image has another id."""
        content = json.dumps([self.image, self.class_name, self.shares])
        return hashlib.sha256(content.encode()).hexdigest()[:16]


def most_doubtful_first(crops: Iterable[Crop]) -> list[Crop]:
    """Crops by the doubt about them; then those with unknown confidence, in the order of their images."""

    def doubt(crop: Crop) -> float:
        return 1.0 if crop.confidence is None else abs(crop.confidence - _MOST_DOUBTFUL)

    return sorted(crops, key=lambda crop: (doubt(crop), crop.image, crop.shares))
