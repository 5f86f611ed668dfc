"""Boxes around the objects of pictures, and a set of such pictures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Size
from vm_embedded.output.box_files import Edges

from .findings import Finding, texts


@dataclass(frozen=True)
class Box:
    """The outer edges of an object in a picture [px], and the name of its class.

    Pixel centers are integers: an image of width w reaches from -0.5 to w - 0.5. x points right, y down.
    """

    name: str
    left: float
    top: float
    right: float
    bottom: float

    @property
    def edges(self) -> Edges:
        """Left, top, right and bottom edge [px]."""
        return self.left, self.top, self.right, self.bottom

    @property
    def center(self) -> Floats:
        """The middle (2,) as x and y [px]."""
        return np.array([(self.left + self.right) / 2.0, (self.top + self.bottom) / 2.0])

    @property
    def width(self) -> float:
        """Distance of left and right edge [px]."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Distance of upper and lower edge [px]."""
        return self.bottom - self.top


@dataclass(frozen=True)
class BoxedPicture:
    """An image file with all its boxes; no boxes means that it shows nothing.

    size: width and height [px]. Size, boxes and lens are those of the image as turned by its EXIF entry. recording: the
    name that frames of one recording share; a split keeps them together. lens: the lens file beside the image, or None.
    """

    image: Path
    size: Size
    boxes: tuple[Box, ...]
    recording: str
    lens: Path | None = None


@dataclass(frozen=True)
class BoxedSet:
    """The usable pictures of a folder in the order of their paths, what the check found, and all names of boxes."""

    pictures: tuple[BoxedPicture, ...]
    findings: tuple[Finding, ...]
    names: tuple[str, ...]

    @property
    def faults(self) -> tuple[str, ...]:
        """A line about each image, file or box that is not used."""
        return texts(self.findings, are_faults=True)

    @property
    def remarks(self) -> tuple[str, ...]:
        """A line about each doubt: the box is used, but look at it."""
        return texts(self.findings, are_faults=False)
