"""The design of a ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Color = tuple[float, float, float]
"""Linear RGB albedo, 0 to 1."""


@dataclass(frozen=True)
class BallDesign:
    """The design of a ball. Each pattern (`kind`) uses count, size, twist and phase in its own way."""

    kind: str
    base: Color
    ink: Color
    accent: Color
    seam_color: Color
    count: int
    size: float  # 0 to 1
    twist: float  # -1 to 1
    phase: float  # [rad]
    seam: float  # width of the seams [rad], 0 without seams
    marks: int  # number of small printed marks
    wear: float  # 0 (new) to 1 (worn out)
    dirt: Color
    gloss: float  # 0 (matt) to 0.95 (polished)
    seed: int

    @property
    def roughness(self) -> float:
        """Roughness of the surface, 0.05 to 1."""
        return 1.0 - self.gloss

    @property
    def specular(self) -> float:
        """Specular parameter of the principled BSDF, 0 to 1."""
        return 0.3 + 0.4 * self.gloss

    @property
    def clearcoat(self) -> float:
        """Clear coat of the principled BSDF, 0 to 1: polished balls have one until it wears off."""
        return max(0.0, 2.0 * self.gloss - 1.0) * (1.0 - self.wear)

    def random(self, stream: int = 0) -> np.random.Generator:
        """A random generator of this design. Different streams are independent."""
        return np.random.default_rng((self.seed, stream))

    def pick(self, counts: tuple[int, ...]) -> int:
        """The design's choice among the counts that its pattern allows."""
        return counts[self.count % len(counts)]
