"""What defines one ball's look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Color = tuple[float, float, float]
"""Albedo in linear RGB, each 0..1."""


@dataclass(frozen=True)
class BallDesign:
    """All that defines one ball's look; each kind reads count, size, twist and phase in its own way."""

    kind: str
    base: Color
    ink: Color
    accent: Color
    seam_color: Color
    count: int
    size: float  # 0..1
    twist: float  # -1..1
    phase: float  # [rad]
    seam: float  # width of the seams [rad], 0 for none
    marks: int  # small printed marks over the pattern
    wear: float  # 0 new .. 1 worn out
    dirt: Color
    gloss: float  # 0 matt .. 0.95 polished
    seed: int

    @property
    def roughness(self) -> float:
        """Roughness of the surface, 0.05..1."""
        return 1.0 - self.gloss

    @property
    def specular(self) -> float:
        """Specular of the principled BSDF, 0..1."""
        return 0.3 + 0.4 * self.gloss

    @property
    def clearcoat(self) -> float:
        """Clear coat of the principled BSDF, 0..1: only polished balls that aren't worn have one."""
        return max(0.0, 2.0 * self.gloss - 1.0) * (1.0 - self.wear)

    def random(self, stream: int = 0) -> np.random.Generator:
        """The design's own chance; its streams don't disturb each other."""
        return np.random.default_rng((self.seed, stream))

    def pick(self, counts: tuple[int, ...]) -> int:
        """One of the counts that a kind knows."""
        return counts[self.count % len(counts)]
