"""The shape of a network on a canvas, as plain values. This module does not need torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.network.manifest import PEAK_OUTPUTS

COARSER = ((2.0, 1), (4.0, 2), (6.0, 2))
"""Of each coarser canvas: its channels, as a multiple of those of the finest one, and its separable convolutions."""

_BLOCK = 8
"""Channels that ONNX Runtime computes together."""


@dataclass(frozen=True)
class CanvasShape:
    """The shape of a network: separable convolutions and channels at full resolution, classes, and classes with peaks.

    Raises InputError if the width is not a multiple of eight.
    """

    depth: int
    width: int
    classes: int
    peaks: int = 0

    def __post_init__(self) -> None:
        if self.width < 1 or self.width % _BLOCK:
            low = max(self.width // _BLOCK, 1) * _BLOCK
            raise InputError(
                f"the width of a network on octaves must be a multiple of 8, such as {low}, not {self.width}"
            )
        if self.depth < 1:
            raise InputError(f"the depth of a network on octaves must be at least 1, not {self.depth}")

    @property
    def outputs(self) -> int:
        """Channels of the output: probabilities of the classes, and four numbers for each class with peaks."""
        return self.classes + PEAK_OUTPUTS * self.peaks

    @property
    def widths(self) -> tuple[int, ...]:
        """Channels at each resolution, the finest first."""
        return (self.width, *(-(-round(self.width * share) // _BLOCK) * _BLOCK for share, _ in COARSER))

    @property
    def depths(self) -> tuple[int, ...]:
        """Separable convolutions on the way down at each resolution, the finest first."""
        return (self.depth, *(each for _, each in COARSER))

    @property
    def summary(self) -> str:
        """The shape in a few words."""
        return f"depth {self.depth}, width {self.width}"

    @property
    def operations(self) -> int:
        """Multiplications and additions for each cell, without activations."""
        widths, depths = self.widths, self.depths
        total = 9.0 * 4 * widths[0] + widths[0] * self.outputs
        if self.peaks:
            total += widths[0] * (9 + widths[0])
        for level, (width, depth) in enumerate(zip(widths, depths, strict=True)):
            share = 0.25**level
            separable = width * (9 + width)
            total += share * separable * (depth + (level + 1 < len(widths)))
            if level + 1 < len(widths):
                total += 0.25 * share * width * (9 + widths[level + 1]) + 0.25 * share * widths[level + 1] * width
        return round(2.0 * total)

    def as_dict(self) -> dict[str, Any]:
        """The shape as plain values for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> CanvasShape:
        """Inverse of `as_dict`. Raises InputError."""
        try:
            return cls(int(data["depth"]), int(data["width"]), int(data["classes"]), int(data["peaks"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"can't read the shape of a network: {error}") from error
