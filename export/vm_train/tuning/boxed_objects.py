"""The objects of a class in boxed pictures, and the split of the pictures by recording."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence

import numpy as np

from vm_embedded.errors import InputError

from ..boxes.box import BoxedPicture, BoxedSet
from ..boxes.summary import rename_advice
from ..boxes.whole import whole_object
from ..data.split import Split
from .windows import Windows

_SLACK = 1.5
"""Validation may become larger than asked by this factor, so that a recording fits."""


def objects_of(picture: BoxedPicture, name: str, is_round: bool) -> Windows:
    """The boxes of a class as windows: their centers, and half of their widths as radii.

    is_round: a box that the picture's border cuts is completed to a square.
    """
    found = [whole_object(box, picture.size, is_round) for box in picture.boxes if box.name == name]
    values = np.array(found).reshape(-1, 3)
    return Windows(values[:, :2], values[:, 2])


def all_objects(pictures: Sequence[BoxedPicture], name: str, is_round: bool) -> Windows:
    """The objects of a class in all pictures."""
    return Windows.joined(Windows.none(), *(objects_of(each, name, is_round) for each in pictures))


def check_boxes(boxes: BoxedSet, name: str, folder: str) -> None:
    """Raise InputError if no picture has a box of a class. folder: for the message."""
    counts = Counter(box.name for picture in boxes.pictures for box in picture.boxes)
    if not boxes.pictures:
        raise InputError(f"no picture of {folder} can be used: vm-train check {folder} --boxes tells why")
    if not counts[name]:
        raise InputError(
            f"{folder} has no box of class {name}, which the close look judges; {rename_advice(counts, name)}"
        )


def split_by_recording(pictures: Sequence[BoxedPicture], validation: float, seed: int) -> Split:
    """Split pictures by position, as text, so that each recording is in one part.

    validation: share of the pictures; about as many are taken. It gets none if every recording is too large for it.
    """
    sizes = Counter(each.recording for each in pictures)
    chosen: set[str] = set()
    count, wanted = 0, validation * len(pictures)
    order = {each: hashlib.sha256(f"{seed}:{each}".encode("utf-8", "surrogateescape")).digest() for each in sizes}
    for recording in sorted(sizes, key=order.__getitem__):
        if count < wanted and count + sizes[recording] <= _SLACK * wanted:
            chosen.add(recording)
            count += sizes[recording]
    parts: dict[bool, list[str]] = {False: [], True: []}
    for position, picture in enumerate(pictures):
        parts[picture.recording in chosen].append(str(position))
    return Split(tuple(parts[False]), tuple(parts[True]))


def boxes_sha256(pictures: Sequence[BoxedPicture]) -> str:
    """Digest of the names of all pictures, their sizes and boxes."""
    rows = [
        (each.image.name, each.size, [(box.name, box.left, box.top, box.right, box.bottom) for box in each.boxes])
        for each in pictures
    ]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()
