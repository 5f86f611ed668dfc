"""The network's own candidates in a picture without lens and pose: it looks everywhere, at several sizes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image, Singles
from vm_embedded.detection.looking import Look
from vm_embedded.detection.peaks import LARGEST_SIZE
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.geometry.lens import Size

from .windows import Windows, grid_windows


class ClassLook:
    """A look network for one of its classes: its answers (n, 4) about that class."""

    def __init__(self, look: Look, name: str) -> None:
        self.name, self.contract = name, look.contract
        self._look, self._number = look, look.contract.names.index(name)

    def run(self, patches: Image) -> Singles:
        """Answers (n, 4) to patches (n, size, size, 3); see Look."""
        return self._look.run(patches)[:, self._number]


_FACTOR = 1.4
"""Ratio of two neighboring sizes; a network still knows an object that is 4/3 of the expected size."""

_SMALLEST = 5.0
"""Smallest radius to look for [px]: smaller windows are many, and show little."""

_UNLIKE = math.log(1.5)
"""A window is no candidate if the network sees an object there that is larger or smaller by this (logarithm)."""


def search_radii(objects: Windows) -> Floats:
    """Radii (s,) to look for [px]: from small to large ones of the objects, without the outermost 2 %."""
    low, high = np.percentile(objects.radii, [2.0, 98.0])
    low = max(float(low), _SMALLEST)
    high = max(float(high), low)
    count = 1 + math.ceil(math.log(high / low) / math.log(_FACTOR))
    return np.geomspace(low, high, count) if count > 1 else np.array([low])


def find_candidates(pyramid: Pyramid, size: Size, look: ClassLook, radii: Floats, above: float, most: int) -> Windows:
    """The windows that look most like an object in a network's first pass, best first.

    size: of the frame [px]. radii (s,): to look for [px]. above: lowest probability of a candidate. most: number of
    candidates. Of candidates that overlap, the better one stays. Raises ModelError if the network does not run.
    """
    windows = grid_windows(size, radii)
    answers = look.run(windows.cut(pyramid, look.contract)).astype(np.float64)
    likely = np.flatnonzero((answers[:, 0] > above) & (np.abs(answers[:, 3]) < _UNLIKE))
    likely = likely[np.argsort(-answers[likely, 0], kind="stable")]
    found = windows.part(likely).moved(answers[likely, 1], answers[likely, 2])
    return found.part(_apart(found, most))


def seen_objects(
    pyramid: Pyramid, size: Size, look: ClassLook, radii: Floats, above: float, most: int
) -> tuple[Windows, Floats]:
    """The objects that a network sees at its candidates, the most probable first, each once.

    Their places and sizes are those that it sees. Also returns its probabilities (n,). Arguments and errors: see
    `find_candidates`.
    """
    candidates = find_candidates(pyramid, size, look, radii, above, most)
    answers = look.run(candidates.cut(pyramid, look.contract)).astype(np.float64)
    order = np.argsort(-answers[:, 0], kind="stable")
    scale = np.exp(np.clip(answers[:, 3], -LARGEST_SIZE, LARGEST_SIZE))
    seen = Windows(candidates.moved(answers[:, 1], answers[:, 2]).centers, candidates.radii * scale).part(order)
    kept = _apart(seen, most)
    return seen.part(kept), answers[order[kept], 0]


def _apart(windows: Windows, most: int) -> npt.NDArray[np.intp]:
    """Numbers of the first windows of which none contains the center of an earlier one, and none is contained in this
    way; at most `most`."""
    kept: list[int] = []
    for number in range(len(windows)):
        if windows.part(np.array([number])).beside(windows.part(np.array(kept, dtype=np.intp)))[0]:
            kept.append(number)
            if len(kept) == most:
                break
    return np.array(kept, dtype=np.intp)
