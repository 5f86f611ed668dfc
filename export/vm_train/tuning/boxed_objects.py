"""The objects of a class in boxed pictures, and the split of the pictures by recording."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from vm_embedded.cameras.image_files import natural_key
from vm_embedded.errors import InputError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.network.manifest import Manifest

from ..boxes.box import BoxedPicture, BoxedSet
from ..boxes.summary import rename_advice
from ..boxes.whole import whole_object
from ..data.split import Split
from .windows import Windows

_SLACK = 1.5
"""A part may become larger than asked by this factor, so that a recording fits."""


def is_round(manifest: Manifest) -> bool:
    """Whether the objects of a network look round from everywhere."""
    return isinstance(manifest.object_shape, Sphere)


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
        raise InputError(f"{folder} has no box of class {name}, which the network finds; {rename_advice(counts, name)}")


def hold_out(pictures: Sequence[BoxedPicture], share: float, seed: int) -> set[int]:
    """Positions of about this share of the pictures, to measure what a network learned from the others.

    Whole recordings. If all are too large for that, it is the last third of each one, in the order of the file names:
    neighboring frames are almost equal, so they stay together in time. `divided` tells this.
    """
    every = range(len(pictures))
    chosen = _whole_recordings(pictures, every, share * len(pictures), seed)
    if not chosen and share:
        for recording in {each.recording for each in pictures}:
            frames = [at for at in every if pictures[at].recording == recording]
            frames.sort(key=lambda at: natural_key(pictures[at].image))
            chosen.update(frames[len(frames) - round(len(frames) / 3) :])
    return chosen


def divided(pictures: Sequence[BoxedPicture], held_out: Iterable[int]) -> bool:
    """Whether a recording has pictures of both kinds, at these positions and elsewhere."""
    chosen = set(held_out)
    kinds = {(each.recording, at in chosen) for at, each in enumerate(pictures)}
    return len(kinds) > len({each.recording for each in pictures})


def split_by_recording(pictures: Sequence[BoxedPicture], validation: float, test: float, seed: int) -> Split:
    """Split pictures by position, as text.

    test: share of the pictures that `hold_out` takes. validation: share of whole recordings among the others; none if
    all are too large for it, or if the test got a part of each one.
    """
    tested = hold_out(pictures, test, seed)
    others = [at for at in range(len(pictures)) if at not in tested]
    wanted = 0.0 if divided(pictures, tested) else validation * len(pictures)
    validated = _whole_recordings(pictures, others, wanted, seed)
    training = set(others) - validated
    return Split(*(tuple(map(str, sorted(part))) for part in (training, validated, tested)))


def _whole_recordings(pictures: Sequence[BoxedPicture], among: Sequence[int], wanted: float, seed: int) -> set[int]:
    """Positions among those given of about so many pictures, as whole recordings; none if all are too large for it."""
    sizes = Counter(pictures[at].recording for at in among)
    chosen: set[str] = set()
    count = 0
    order = {each: hashlib.sha256(f"{seed}:{each}".encode("utf-8", "surrogateescape")).digest() for each in sizes}
    for recording in sorted(sizes, key=order.__getitem__):
        if count < wanted and count + sizes[recording] <= _SLACK * wanted:
            chosen.add(recording)
            count += sizes[recording]
    return {at for at in among if pictures[at].recording in chosen}


def boxes_sha256(pictures: Sequence[BoxedPicture]) -> str:
    """Digest of the names of all pictures, their sizes and boxes."""
    rows = [
        (each.image.name, each.size, [(box.name, box.left, box.top, box.right, box.bottom) for box in each.boxes])
        for each in pictures
    ]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()
