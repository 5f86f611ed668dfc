"""The arrangement of points that a network was trained on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vm_embedded.errors import InputError, unknown

GRIDS = ("visual", "hexagonal")


@dataclass(frozen=True)
class Grid:
    """The arrangement of points that a network was trained on.

    kind: visual, the mesh of the manifest; or hexagonal, the paper's baseline, a regular grid of pixels, which the
    runtime does not have. equal_at: the distance [m] at which both have the same number of points on an object; 0 for
    the same number of points in the whole picture. Raises InputError.
    """

    kind: str = "visual"
    equal_at: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in GRIDS:
            raise InputError(unknown("grid", self.kind, GRIDS))
        if not 0.0 <= self.equal_at < math.inf:
            raise InputError(f"equal_at must be a finite distance of at least 0 m, not {self.equal_at!r}")

    @property
    def is_visual(self) -> bool:
        """Whether the points are those of the Visual Mesh. Only then the network finds objects and runs on a robot."""
        return self.kind == "visual"


VISUAL = Grid()
