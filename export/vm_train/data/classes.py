"""Classes and their colors in masks, and the labels that a mask gives to its pixels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Image
from vm_embedded.errors import InputError
from vm_embedded.network.manifest import MOST_CLASSES

from .picture_files import PictureFault

Labels = npt.NDArray[np.int8]
"""Numbers of classes, by pixel; UNLABELED where the mask is transparent."""

UNLABELED = -1

Color = tuple[int, int, int]

_OPAQUE = 0xFF000000  # alpha, the highest byte of a BGRA pixel as one number
_STRIP = 64  # rows to label at a time


@dataclass(frozen=True)
class Classes:
    """Classes in order, each with the RGB colors that masks have for it. Transparent pixels are unlabeled.

    Raises InputError if two classes share a color, or there are fewer than two or more than MOST_CLASSES.
    """

    colors: Mapping[str, tuple[Color, ...]]

    def __post_init__(self) -> None:
        if len(self.colors) < 2:
            raise InputError(f"a network needs at least two classes, not only {list(self.colors)}")
        if len(self.colors) > MOST_CLASSES:
            raise InputError(f"a network can have at most {MOST_CLASSES} classes, not {len(self.colors)}")
        owner: dict[Color, str] = {}
        for name, colors in self.colors.items():
            for color in colors:
                if color in owner:
                    raise InputError(f"classes {owner[color]} and {name} share the color {list(color)}")
                owner[color] = name

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.colors)

    def labels(self, mask: Image) -> Labels:
        """Labels (h, w) of a BGRA or BGR mask (h, w, 4 or 3).

        Raises PictureFault naming a color that no class has.
        """
        bgra = mask if mask.shape[2] == 4 else cv2.cvtColor(mask, cv2.COLOR_BGR2BGRA)
        pixels = np.ascontiguousarray(bgra).view("<u4")[..., 0]
        labels = np.empty(pixels.shape, dtype=np.int8)
        # In strips: their intermediate results stay in the cache, which makes it twice as fast.
        for top in range(0, len(pixels), _STRIP):
            labels[top : top + _STRIP] = self._labels(pixels[top : top + _STRIP])
        unknown = labels == len(self.colors)
        if unknown.any():
            raise PictureFault(self._unknown_color(pixels[unknown]), "color")
        return labels

    def _labels(self, pixels: npt.NDArray[np.uint32]) -> Labels:
        """Labels (h, w) of BGRA pixels (h, w); colors of no class get the number of classes."""
        keys = pixels | np.uint32(_OPAQUE)
        labels = np.full(pixels.shape, len(self.colors), dtype=np.int8)
        for number, colors in enumerate(self.colors.values()):
            for red, green, blue in colors:
                here = keys == np.uint32(_OPAQUE | red << 16 | green << 8 | blue)
                labels -= np.int8(len(self.colors) - number) * here.view(np.int8)
        np.putmask(labels, pixels < 1 << 24, UNLABELED)
        return labels

    def _unknown_color(self, pixels: npt.NDArray[np.uint32]) -> str:
        """A message about pixels (n,) of unknown colors: the most frequent color, and the nearest color of a class."""
        keys, counts = np.unique(pixels & 0xFFFFFF, return_counts=True)
        often = int(keys[counts.argmax()])
        color = (often >> 16, often >> 8 & 255, often & 255)
        known = [(name, each) for name, colors in self.colors.items() for each in colors]
        name, near = min(known, key=lambda each: sum((a - b) ** 2 for a, b in zip(each[1], color, strict=True)))
        others = f" and {len(keys) - 1} more" if len(keys) > 1 else ""
        return (
            f"{len(pixels)} pixels of the mask have colors that belong to no class: {list(color)}{others}; "
            f"the nearest is {list(near)} of {name}"
        )
