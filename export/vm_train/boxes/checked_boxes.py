"""Boxes that fit their image: clipped at its border, each of them once."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import overlap
from vm_workstation.box_grid import BoxGrid

from .annotation import RawBox
from .box import Box
from .findings import LONG_BOX, SAME_BOX, Finding

_SLIGHTLY = 2.0, 0.1
"""How far a box may reach outside of the image: [px], or as a share of its own size. It is clipped there."""

_ROUNDEST = 2.0
"""Largest ratio of width and height of a round object that is inside the image."""

_NEAR_BORDER = 3.0
"""Boxes nearer to the border than this are cut by it, drawn by hand [px]."""

_EQUAL = 0.9
"""Intersection over union from which on two boxes of a class are the same."""


@dataclass(frozen=True)
class CheckedBoxes:
    """The good boxes of an image, and what the check found.

    unusable: a line each about boxes that are missing in `good`. Their objects must not become background, so the image
    can't be used.
    """

    good: list[Box]
    findings: list[Finding]
    unusable: list[str]


def is_cut(box: Box, size: Size) -> bool:
    """Whether a box reaches to the border of an image of this width and height [px]: part of the object is outside."""
    near = _NEAR_BORDER - 0.5
    return box.left < near or box.top < near or box.right > size[0] - 1 - near or box.bottom > size[1] - 1 - near


def is_round(box: Box) -> bool:
    """Whether width and height of a box differ by less than a factor of 2, as those of a ball in full view."""
    return max(box.width, box.height) <= _ROUNDEST * min(box.width, box.height)


def checked_boxes(boxes: list[RawBox], size: Size, round_names: Collection[str]) -> CheckedBoxes:
    """Check the boxes of an image of this width and height [px].

    boxes: with edges in pixels from 0 to width and height. round_names: classes of which a long box gets a remark; the
    box stays, so that nothing else takes its place for background.
    """
    good: list[Box] = []
    places: list[str] = []
    grid = BoxGrid(_EQUAL)
    findings, unusable = [], []
    for raw in boxes:
        try:
            box = _inside(raw, size)
        except InputError as error:
            unusable.append(f"{raw.place}: {error}")
            continue
        same = [at for at, other in grid.near(box.name, box.edges) if overlap(box.edges, other) >= _EQUAL]
        if same:
            text = f"{raw.place}: the same box of {box.name} as {_short(places[min(same)])}; box not used"
            findings.append(Finding(SAME_BOX, text))
            continue
        if box.name in round_names and not is_cut(box, size) and not is_round(box):
            text = (
                f"{raw.place}: {box.name} of {_by(box.width, box.height)} px, but width and height of a {box.name} "
                f"in full view differ by a factor of {_ROUNDEST:g} at most; is it partly hidden? box kept"
            )
            findings.append(Finding(LONG_BOX, text, is_fault=False))
        grid.add(box.name, box.edges)
        good.append(box)
        places.append(raw.place)
    return CheckedBoxes(good, findings, unusable)


def _inside(raw: RawBox, size: Size) -> Box:
    """The box, clipped to the image. Raises InputError if it is not a box, or outside of the image."""
    left, top, right, bottom = raw.edges
    if not all(map(math.isfinite, raw.edges)):
        raise InputError(f"edges must be finite numbers, not {', '.join(f'{each:g}' for each in raw.edges)}")
    width, height = right - left, bottom - top
    if width <= 0.0 or height <= 0.0:
        raise InputError(f"size {_by(width, height)} px; width and height must be above 0")
    for low, high, limit, extent in ((left, right, size[0], width), (top, bottom, size[1], height)):
        allowed = max(_SLIGHTLY[0], _SLIGHTLY[1] * extent)
        if max(-low, high - limit) > allowed or min(high, limit) <= max(low, 0.0):
            shown = ", ".join(f"{each:.1f}" for each in raw.edges)
            raise InputError(f"left, top, right, bottom {shown} px is outside of the image of {_by(*size)} px")
    return Box(
        raw.name,
        max(left, 0.0) - 0.5,
        max(top, 0.0) - 0.5,
        min(right, float(size[0])) - 0.5,
        min(bottom, float(size[1])) - 0.5,
    )


def _by(width: float, height: float) -> str:
    return f"{width:.4g} x {height:.4g}"


def _short(place: str) -> str:
    """A place without the name of its file."""
    return " ".join(place.rsplit(" ", 2)[-2:])
