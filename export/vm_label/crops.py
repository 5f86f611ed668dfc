"""A crop: a box of an image that a person judges, or drew."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vm_embedded.arrays import numbers_or_nan
from vm_embedded.errors import InputError
from vm_embedded.output.box_files import SAME_PLACE, Shares, edges, overlap

_ROUNDING = 2e-6
"""How far the edge of a box of six digits may be outside of the image that it was clipped to."""

_MOST_DOUBTFUL = 0.5
"""Confidences near this come first. Those of a close look are calibrated probabilities."""


@dataclass(frozen=True)
class Crop:
    """A box to judge.

    image: path relative to the folder of boxes. shares: center x and y, width and height, as shares of the image.
    confidence: 0 to 1; None if unknown. drawn: the id that the page gave to a box that a person drew; "" for others.
    """

    image: str
    class_name: str
    shares: Shares
    confidence: float | None
    drawn: str = ""

    @cached_property
    def id(self) -> str:
        """Sixteen hexadecimal digits. Another box, class or image has another id."""
        if self.drawn:
            return self.drawn
        content = json.dumps([self.image, self.class_name, self.shares])
        return hashlib.sha256(content.encode()).hexdigest()[:16]


def checked_shares(values: Any) -> Shares:
    """The box of four numbers: center and size, as shares of the image, with six digits.

    Raises InputError for anything else, for a box without an area, and for one that is not in the image.
    """
    numbers = numbers_or_nan(values)
    if numbers.shape != (4,) or not np.isfinite(numbers).all() or min(numbers[2:]) <= 0.0:
        raise InputError(f"a box is four numbers, center and size above 0, not {str(values)[:60]}")
    x, y, width, height = numbers.round(6).tolist()
    sides = edges((x, y, width, height))
    if min(sides) < -_ROUNDING or max(sides) > 1.0 + _ROUNDING:
        raise InputError(f"the box {str(values)[:60]} is not inside the image; its edges must be from 0 to 1")
    return x, y, width, height


def most_doubtful_first(crops: Iterable[Crop]) -> list[Crop]:
    """Crops by the doubt about them; then those with unknown confidence, in the order of their images."""

    def doubt(crop: Crop) -> float:
        return 1.0 if crop.confidence is None else abs(crop.confidence - _MOST_DOUBTFUL)

    return sorted(crops, key=lambda crop: (doubt(crop), crop.image, crop.shares))


def whole_picture(image: str, classes: Iterable[str]) -> Crop:
    """What a person answers about an image without boxes: "no" says that it shows no object of these classes."""
    return Crop(image, ", ".join(classes), (0.0, 0.0, 0.0, 0.0), None)


def replaced(crops: Iterable[Crop], answers: Mapping[str, str]) -> frozenset[str]:
    """Ids of the crops that a drawn box replaces: those of its class and image at the same place.

    answers: by crop, oldest first. Only an accepted box replaces others; of two drawn ones, the one accepted last.
    """
    by_image: dict[str, list[Crop]] = defaultdict(list)
    for crop in crops:
        by_image[crop.image].append(crop)
    newest_first = {crop: place for place, crop in enumerate(reversed([*answers]))}
    kept: set[str] = set()
    gone: set[str] = set()
    accepted = (crop for each in by_image.values() for crop in each if crop.drawn and answers.get(crop.id) == "yes")
    for new in sorted(accepted, key=lambda crop: newest_first[crop.id]):
        if new.id not in gone:
            kept.add(new.id)
            others = (each for each in by_image[new.image] if each.class_name == new.class_name and each.id not in kept)
            gone |= {each.id for each in others if overlap(edges(each.shares), edges(new.shares)) > SAME_PLACE}
    return frozenset(gone)
