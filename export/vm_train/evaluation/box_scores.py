"""Scores of what a network finds in frames with boxes: found and false objects, and average precision, by size.

A found object is right if its box and a box of the frame have an IoU of at least 0.5. Each box of the frame counts
once, for the most confident object, as in `scores.object_scores`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.files import read_bytes
from vm_embedded.output.box_files import overlap

from ..boxes.box import Box, BoxedPicture
from ..boxes.unlabeled import FoundBox
from ..scores.curves import without_nan
from ..scores.object_ranking import Ranking
from ..scores.object_scores import OVERLAPS, matches
from .worst_errors import WorstError, WorstErrors

SIZES = {
    "all": (0.0, math.inf),
    "below 16": (0.0, 16.0),
    "16 to 32": (16.0, 32.0),
    "32 to 64": (32.0, 64.0),
    "from 64": (64.0, math.inf),
}
"""Sizes of boxes [px]: the square root of their areas."""


@dataclass(frozen=True)
class JudgedFrame:
    """A frame with its boxes of the class, the objects found in it, the most confident first, and for each of them the
    number of the box that it matches, or None."""

    picture: BoxedPicture
    boxes: tuple[Box, ...]
    found: tuple[FoundBox, ...]
    matches: tuple[int | None, ...]

    @classmethod
    def of(cls, picture: BoxedPicture, class_name: str, found: Sequence[FoundBox]) -> JudgedFrame:
        """Judge what was found in a picture, in any order."""
        boxes = tuple(box for box in picture.boxes if box.name == class_name)
        ranked = tuple(sorted(found, key=lambda each: -each.probability))
        overlaps = [[overlap(each.box.edges, box.edges) for box in boxes] for each in ranked]
        chosen = matches(np.array(overlaps).reshape(len(ranked), len(boxes)), OVERLAPS[0])
        return cls(picture, boxes, ranked, tuple(chosen))

    def worst(self, threshold: float) -> WorstErrors:
        """The largest missed box, and the most confident false object, if objects of this confidence are reported."""
        reported = [pair for pair in zip(self.found, self.matches, strict=True) if pair[0].probability >= threshold]
        hit = {match for _, match in reported}
        missed = [box for number, box in enumerate(self.boxes) if number not in hit]
        false = [each for each, match in reported if match is None]
        image = self.picture.image
        outlines = tuple(map(_corners, self.boxes)), tuple(_corners(each.box) for each, _ in reported)

        def error(box: Box, rank: float) -> WorstError:
            content = partial(read_bytes, image)
            return WorstError(image, content, box.name, rank, box.center, _size(box) / 2.0, *outlines)

        largest = max(missed, key=_size, default=None)
        return WorstErrors(
            () if largest is None else (error(largest, _size(largest)),),
            tuple(error(each.box, each.probability) for each in false[:1]),
        )


@dataclass(frozen=True)
class BoxScores:
    """The scores of a network. name: as the user knows it. threshold: lowest confidence of a reported object."""

    name: str
    threshold: float
    frames: tuple[JudgedFrame, ...]

    def ranking(self, size: str) -> Ranking:
        """The found objects of a size in SIZES: right ones by the size of their box, false ones by their own."""
        low, high = SIZES[size]
        counted = [
            (each.probability, match is not None)
            for frame in self.frames
            for each, match in zip(frame.found, frame.matches, strict=True)
            if low <= _size(each.box if match is None else frame.boxes[match]) < high
        ]
        truths = sum(low <= _size(box) < high for frame in self.frames for box in frame.boxes)
        confidence, right = np.array(counted, dtype=np.float64).reshape(-1, 2).T
        return Ranking(confidence=confidence, right=right > 0.0, truths=truths, pictures=len(self.frames))

    def as_dict(self) -> dict[str, dict[str, float | None]]:
        """The scores of each size, for JSON; None for a score without a value."""
        return {size: _scores(self.ranking(size), self.threshold) for size in SIZES}

    def worst(self) -> WorstErrors:
        """The worst errors of all frames."""
        return sum((frame.worst(self.threshold) for frame in self.frames), WorstErrors())


def _scores(ranking: Ranking, threshold: float) -> dict[str, float | None]:
    outcome = ranking.at(threshold)
    values = {"recall": outcome.recall, "average_precision": ranking.precision_recall.average_precision}
    return {"boxes": ranking.truths, "found": outcome.hits, "false": outcome.false, **without_nan(values)}


def _size(box: Box) -> float:
    return math.sqrt(box.width * box.height)


def _corners(box: Box) -> Floats:
    """The corners (4, 2) [px]."""
    left, top, right, bottom = box.edges
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
