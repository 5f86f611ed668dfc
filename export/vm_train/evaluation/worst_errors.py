"""The worst errors of a network: the largest missed objects, and the most confident false ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.detection.detection import Detection

from ..data.picture_files import PictureFiles
from ..scores.object_scores import Mistakes
from ..scores.overlaps import TrueObject

MOST = 12
"""Errors of each kind to keep."""


@dataclass(frozen=True, eq=False)
class WorstError:
    """A picture with a missed or a false object.

    content: reads the bytes of the image file. rank: radius of the largest missed object, or size of its box [px], or
    confidence of the most confident false one. center (2,) and radius [px]: of this object. true, found: outlines
    (m, 2) [px] of all objects of the class.
    """

    image: Path
    content: Callable[[], bytes]
    class_name: str
    rank: float
    center: Floats
    radius: float
    true: tuple[Floats, ...]
    found: tuple[Floats, ...]


@dataclass(frozen=True)
class WorstErrors:
    """Pictures with missed objects and pictures with false objects, the worst first."""

    missed: tuple[WorstError, ...] = ()
    false: tuple[WorstError, ...] = ()

    def __add__(self, other: WorstErrors) -> WorstErrors:
        """The worst errors of both."""
        return WorstErrors(_worst(self.missed + other.missed), _worst(self.false + other.false))


def worst_errors_of(
    files: PictureFiles,
    class_name: str,
    truths: Sequence[TrueObject],
    found: Sequence[Detection],
    mistakes: Mistakes[Detection],
) -> WorstErrors:
    """The largest missed and the most confident false object of a picture. truths, found: all objects of the class."""
    if not mistakes.missed and not mistakes.false:
        return WorstErrors()
    place = files.image, partial(files.read, "image")
    true_outlines = tuple(outline for each in truths for outline in _outlines(each.mask))
    found_outlines = tuple(each.outline for each in found)
    missed, false = [], []
    if mistakes.missed:
        largest = max(mistakes.missed, key=lambda each: each.radius)
        rows, columns = np.nonzero(largest.mask)
        center = np.array([columns.mean(), rows.mean()]) if len(rows) else np.zeros(2)
        # Of the part inside the picture: the whole outline may be endless.
        radius = float(np.sqrt(largest.mask.sum(dtype=np.float64) / np.pi))
        missed.append(WorstError(*place, class_name, radius, center, radius, true_outlines, found_outlines))
    if mistakes.false:
        worst = mistakes.false[0]
        rank, center = worst.confidence, worst.center
        false.append(WorstError(*place, class_name, rank, center, worst.radius, true_outlines, found_outlines))
    return WorstErrors(tuple(missed), tuple(false))


def _worst(errors: Sequence[WorstError]) -> tuple[WorstError, ...]:
    return tuple(sorted(errors, key=lambda each: (-each.rank, str(each.image)))[:MOST])


def _outlines(mask: Mask | Singles) -> list[Floats]:
    """Outlines (m, 2) [px] of the set pixels of a mask (h, w)."""
    found, _ = cv2.findContours((mask >= 0.5).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return [each.reshape(-1, 2).astype(np.float64) for each in found]
