"""Frames that are read one by one: from images, videos or bags."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..arrays import Image
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".pgm", ".ppm", ".tif", ".tiff", ".webp")
"""Ends of the names of image files."""


@dataclass(frozen=True)
class Frame:
    """One frame of a source.

    index: its number, from 0. source: its name in messages. stem: name of the file that it is from, without suffix.
    read: returns the image, BGR, or in the file's own channels if the pixel format is another; raises InputError. path:
    its image file; None for a frame of a video. stamp: time within its video or recording [s], or None. lens,
    orientation: of the camera, if the source knows them.
    """

    index: int
    source: str
    stem: str
    read: Callable[[], Image]
    path: Path | None = None
    stamp: float | None = None
    lens: Lens | None = None
    orientation: Orientation | None = None


@dataclass(frozen=True)
class Source:
    """Frames to iterate over.

    count: number of frames, if known. rate: frames per second [1/s], if known. files: that the frames are read from.
    remarks: returns what the user should know, after the last frame; some may be empty.
    """

    frames: Iterator[Frame]
    count: int | None
    rate: float | None = None
    files: tuple[Path, ...] = ()
    remarks: Callable[[], Sequence[str]] = tuple


def joined(opened: Sequence[Source]) -> Source:
    """Several sources as one, with frames numbered from 0."""
    if len(opened) == 1:
        return opened[0]
    frames = (frame for source in opened for frame in source.frames)
    numbered = (replace(frame, index=index) for index, frame in enumerate(frames))
    counts = [source.count for source in opened]
    files = tuple(each for source in opened for each in source.files)
    count = None if None in counts else sum(each or 0 for each in counts)
    return Source(numbered, count, None, files, lambda: [each for source in opened for each in source.remarks()])
