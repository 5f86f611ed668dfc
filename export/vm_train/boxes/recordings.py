"""Recordings: which frames belong together, by their folders and file names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePath

_COMMON = {"images", "labels", "jpegimages", "annotations", "train", "val", "valid", "validation", "test", "data"}
"""Folders that annotation tools make; frames of one recording lie in several of them."""

_COPY = re.compile(r"_(jpe?g|png|bmp)\.rf\.[0-9A-Za-z]+$")
"""What Roboflow appends to the name of each copy of a frame."""

_NUMBERS = re.compile(r"(?:[_\-. ]+\d+|(?<=\d)[Tt]\d+Z?)+$")
"""Running numbers and timestamps at the end, each after a separator."""

_DATE = re.compile(r"\d{4}-?\d\d-?\d\d")


def recordings(images: Sequence[PurePath]) -> list[str]:
    """The recording of each image, given their paths below the folder of the data set.

    The sub-folder, if the images lie in several; otherwise, the file name without the running number or timestamp at
    its end: 20230709_r5_cam0_20230709_104538.jpg and 20230709_r5_cam0_20230709_104542.jpg belong to
    20230709_r5_cam0. Folders such as images/ and train/ do not count.
    """
    folders = ["/".join(part for part in path.parts[:-1] if part.lower() not in _COMMON) for path in images]
    if len(set(folders)) > 1:
        return [folder or "." for folder in folders]
    return [recording_of(path.stem) for path in images]


def recording_of(stem: str) -> str:
    """The recording of a frame by the stem of its file name.

    A name that is only a number or a timestamp gives its date; without a date, it gives an empty name.
    """
    stem = _COPY.sub("", stem)
    name = _NUMBERS.sub("", stem)
    if name == stem:
        name = stem.rstrip("0123456789").rstrip("_-. ")
    if name.strip("0123456789_-. "):
        return name
    date = _DATE.match(stem)
    return date[0] if date else ""
