"""Annotations of an image as a file gives them, before they are checked against the image."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import Edges

from .findings import Finding


@dataclass(frozen=True)
class RawBox:
    """A box as the file gives it.

    place: where it is written, for messages. edges: left, top, right, bottom, from 0 at the image's left and upper edge
    to its width and height [px], or as shares from 0 to 1.
    """

    place: str
    name: str
    edges: Edges


@dataclass(frozen=True)
class Annotation:
    """The boxes of an image in one file.

    file: that file, for messages. size: width and height of the image that the file states [px], or None. shares:
    whether the edges are shares of width and height.
    """

    image: Path
    file: str
    boxes: tuple[RawBox, ...]
    size: Size | None = None
    shares: bool = False


@dataclass(frozen=True)
class Annotations:
    """All annotations of a folder in one format, and the faults of its files.

    spoiled: images that a fault names already, and that are not used. complete: whether all annotation files could be
    read; otherwise, an image without annotation is no fault of its own.
    """

    found: tuple[Annotation, ...]
    faults: tuple[Finding, ...]
    spoiled: frozenset[Path] = frozenset()
    complete: bool = True
