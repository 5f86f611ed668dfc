"""Objects that a detector sees clearly where no box is: nobody drew one, or another thing looks like the object."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.output.box_files import overlap

from .box import Box, BoxedPicture
from .findings import NO_BOX, Finding


@dataclass(frozen=True)
class FoundBox:
    """An object that a detector sees in an image: its box, named by its class, and its probability from 0 to 1."""

    image: Path
    box: Box
    probability: float


def without_box(pictures: Sequence[BoxedPicture], sightings: Iterable[FoundBox]) -> list[FoundBox]:
    """The sightings that overlap no box of their class, the most probable first.

    Of sightings that overlap each other, only the most probable one is left. Sightings in images that are not among the
    pictures are ignored.
    """
    taken = {picture.image: list(picture.boxes) for picture in pictures}
    found = []
    for each in sorted(sightings, key=lambda each: (-each.probability, str(each.image), each.box.left, each.box.top)):
        if each.image in taken and not any(_meet(each.box, box) for box in taken[each.image]):
            taken[each.image].append(each.box)
            found.append(each)
    return found


def describe(sighting: FoundBox, folder: Path) -> Finding:
    """A remark about an unlabeled object, with the image's path below the folder."""
    box = sighting.box
    x, y = box.center
    text = (
        f"{sighting.image.relative_to(folder)}: without a box, but looks like a {box.name}: x {x:.0f}, y {y:.0f}, "
        f"{box.width:.0f} x {box.height:.0f} px (probability {sighting.probability:.3f})"
    )
    return Finding(NO_BOX, text, is_fault=False)


def _meet(one: Box, other: Box) -> bool:
    return one.name == other.name and overlap(one.edges, other.edges) > 0.0
