"""Draws the design of a ball: its pattern, colors, marks, wear and gloss.

The paper has 140 models of balls, also with less than 50 % white (section "Dataset").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import range_of, some_of, uniform

from .design import BallDesign, Color
from .patterns import PATTERNS

HUES = {
    "orange": (1.0, 0.45, 0.05), "yellow": (1.0, 0.88, 0.1), "red": (0.85, 0.08, 0.1), "blue": (0.08, 0.25, 0.8),
    "green": (0.1, 0.6, 0.2), "pink": (1.0, 0.35, 0.65), "cyan": (0.1, 0.7, 0.85), "purple": (0.45, 0.15, 0.65),
    "lime": (0.75, 0.95, 0.1), "navy": (0.06, 0.1, 0.35), "maroon": (0.45, 0.05, 0.12), "gold": (0.8, 0.62, 0.25),
}  # fmt: skip
"""Saturated colors, sRGB."""


@dataclass(frozen=True)
class DesignRanges:
    """Section [ball_design]: designs of balls and how often they occur."""

    kinds: tuple[str, ...] = some_of(
        tuple(PATTERNS),
        "patterns; one that is listed twice is twice as frequent",
        (*PATTERNS, *("classic",) * 4, *("panels", "pinwheel", "tango", "mosaic", "plain", "triangles", "stars") * 2),
    )
    white: float = share(0.65, "share of designs with a white base; the others have a saturated or a black one")
    hues: tuple[str, ...] = some_of(tuple(HUES), "saturated colors; one that is listed twice is twice as frequent")
    dark: float = share(0.2, "share of black bases among those that are not white")
    black: float = share(0.5, "share of designs with black ink; the others have saturated or dark gray ink")
    bright: float = share(0.06, "share of overexposed designs: all albedo near 1, almost no contrast")
    marked: float = share(0.4, "share of designs with small printed marks")
    worn: float = share(0.45, "share of worn designs")
    wear: tuple[float, float] = range_of(
        0.05, 0.9, "wear of worn designs: dirt, scratches, lost ink", limits=(0.0, 1.0)
    )
    roughness: tuple[float, float] = range_of(0.08, 0.9, "roughness of the surface", limits=(0.05, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


def draw_design(random: np.random.Generator, ranges: DesignRanges) -> BallDesign:
    """Draw a design."""
    kind = str(random.choice(ranges.kinds))
    white = random.random() < ranges.white
    if white:
        base = _gray(random, 0.85, 0.98)
    else:
        base = _gray(random, 0.05, 0.2) if random.random() < ranges.dark else _saturated(random, ranges.hues)
    if random.random() < ranges.black:
        # On a black base the ink is white: black ink would be invisible.
        ink = _gray(random, 0.04, 0.15) if max(base) > 0.06 else _gray(random, 0.85, 0.98)
    else:
        ink = _saturated(random, ranges.hues) if random.random() < 0.8 else _gray(random, 0.2, 0.45)
    accent = _saturated(random, ranges.hues) if random.random() < 0.65 else _gray(random, 0.05, 0.95)
    seam_color = _scaled(base, random.uniform(0.3, 0.9)) if random.random() < 0.6 else _gray(random, 0.05, 0.4)
    if random.random() < ranges.bright:
        rest = random.uniform(0.03, 0.15)
        base, ink, accent, seam_color = (_scaled(color, rest, 1.0 - rest) for color in (base, ink, accent, seam_color))
    return BallDesign(
        kind, base, ink, accent, seam_color,
        count=int(random.integers(0, 60)),
        size=float(random.uniform()),
        twist=float(random.uniform(-1.0, 1.0)),
        phase=uniform(random, (0.0, 2.0 * math.pi)),
        seam=uniform(random, (0.012, 0.035)) if random.random() < 0.75 else 0.0,
        marks=int(random.integers(1, 5)) if random.random() < ranges.marked else 0,
        wear=uniform(random, ranges.wear) if random.random() < ranges.worn else 0.0,
        dirt=_linear(np.array((0.42, 0.36, 0.24)) * random.uniform(0.6, 1.3, 3)),
        gloss=1.0 - uniform(random, ranges.roughness),
        seed=int(random.integers(2**31)),
    )  # fmt: skip


def _linear(color: Floats) -> Color:
    """Linear RGB of an sRGB color (3,)."""
    red, green, blue = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4).tolist()
    return red, green, blue


def _saturated(random: np.random.Generator, hues: tuple[str, ...]) -> Color:
    """A random variation of one of the hues, linear RGB."""
    color = np.array(HUES[str(random.choice(hues))]) * random.uniform(0.75, 1.05) + random.uniform(-0.06, 0.06, 3)
    return _linear(np.clip(color, 0.01, 0.99))


def _gray(random: np.random.Generator, low: float, high: float) -> Color:
    """A random gray of an sRGB level between two limits, linear RGB."""
    return _linear(np.clip(random.uniform(low, high) + random.uniform(-0.02, 0.02, 3), 0.01, 0.99))


def _scaled(color: Color, factor: float, offset: float = 0.0) -> Color:
    red, green, blue = (factor * each + offset for each in color)
    return red, green, blue
