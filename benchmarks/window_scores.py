"""What a close look finds in boxed frames: its boxes, and false objects among all other places."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.pyramid import Pyramid
from vm_train.boxes.box import BoxedPicture
from vm_train.look.collection import random_of
from vm_train.tuning.boxed_objects import objects_of
from vm_train.tuning.candidates import ClassLook, find_candidates
from vm_train.tuning.windows import Windows, random_windows

REPORTED = 0.5
"""Probability from which a detector reports an object, unless its settings say another one."""

PASSING = 2000
"""One of so many other places passes the threshold of `recall`."""

_RANDOM, _CANDIDATES = 40, 40
"""Random places, and largest number of candidates, in a frame."""

_ABOVE = 0.01


@dataclass(frozen=True, eq=False)
class Looked:
    """Windows in several frames after all looks: where they are now, the numbers (n,) of their frames, and their
    probabilities (n,)."""

    windows: Windows
    frames: npt.NDArray[np.intp]
    probabilities: Floats

    @classmethod
    def joined(cls, parts: Sequence[Looked]) -> Looked:
        """All windows of several parts."""
        return cls(
            Windows.joined(Windows.none(), *(each.windows for each in parts)),
            np.concatenate([np.empty(0, dtype=np.intp), *(each.frames for each in parts)]),
            np.concatenate([np.empty(0), *(each.probabilities for each in parts)]),
        )


@dataclass(frozen=True, eq=False)
class WindowScores:
    """boxes: the windows at boxes of the class. others: random places and the network's own candidates that are, after
    all looks, beside all boxes."""

    boxes: Looked
    others: Looked

    @property
    def threshold(self) -> float:
        """The probability that 1 in 2000 of the other places exceeds; NaN without any."""
        ranked = np.sort(self.others.probabilities)[::-1]
        return float(ranked[len(ranked) // PASSING]) if len(ranked) else np.nan

    @property
    def recall(self) -> float:
        """Share of the boxes with a larger probability than the threshold; NaN without boxes."""
        return _share(self.boxes.probabilities > self.threshold)

    @property
    def reported(self) -> int:
        """Number of boxes that a detector reports."""
        return int((self.boxes.probabilities >= REPORTED).sum())

    @property
    def false(self) -> int:
        """Number of other places that a detector reports."""
        return int((self.others.probabilities >= REPORTED).sum())

    def as_dict(self) -> dict[str, float | int | None]:
        """Plain values for JSON; None for what has no value."""
        values = {"threshold": self.threshold, "recall": self.recall}
        return {
            "boxes": len(self.boxes.probabilities),
            "others": len(self.others.probabilities),
            "reported_boxes": self.reported,
            "reported_others": self.false,
            **{name: None if np.isnan(value) else round(value, 4) for name, value in values.items()},
        }


def score_frames(
    look: ClassLook,
    frames: Sequence[BoxedPicture],
    is_round: bool,
    radii: Floats,
    report: Callable[[], None],
) -> WindowScores:
    """The scores of a network for its class on frames.

    radii (s,): of the objects to look for [px]. report: is called after each frame. Raises InputError for a frame that
    can't be read, and ModelError.
    """
    boxes: list[Looked] = []
    others: list[Looked] = []
    for number, frame in enumerate(frames):
        pyramid = Pyramid(read_image(frame.image), "bgr")
        objects = objects_of(frame, look.name, is_round)
        somewhere = random_windows(frame.size, radii, _RANDOM, random_of(0, frame.image.name))
        candidates = find_candidates(pyramid, frame.size, look, radii, _ABOVE, _CANDIDATES)
        boxes.append(_looked(pyramid, look, objects, number))
        found = _looked(pyramid, look, Windows.joined(somewhere, candidates), number)
        beside = found.windows.beside(objects)
        others.append(Looked(found.windows.part(beside), found.frames[beside], found.probabilities[beside]))
        report()
    return WindowScores(Looked.joined(boxes), Looked.joined(others))


def _looked(pyramid: Pyramid, look: ClassLook, windows: Windows, number: int) -> Looked:
    answers = look.run(windows.cut(pyramid, look.contract)).astype(np.float64)
    seen = windows.moved(answers[:, 1], answers[:, 2])
    return Looked(seen, np.full(len(windows), number, dtype=np.intp), answers[:, 0])


def _share(right: npt.NDArray[np.bool_]) -> float:
    return float(right.mean()) if len(right) else np.nan
