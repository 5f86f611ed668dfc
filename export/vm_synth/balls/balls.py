"""Balls: designs drawn from ranges, and painted as textures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import range_of, some_of, uniform

from .design import BallDesign, Color
from .painting_sphere import Sphere, directions_of, unit
from .patterns import KINDS
from .prints import logo, print_images, word

WHITE_ALBEDO, WHITE_CHROMA = 0.45, 0.25
"""What counts as white: the darkest channel is above the first, the channels differ by less than the second."""

HUES = {
    "orange": (1.0, 0.45, 0.05), "yellow": (1.0, 0.88, 0.1), "red": (0.85, 0.08, 0.1), "blue": (0.08, 0.25, 0.8),
    "green": (0.1, 0.6, 0.2), "pink": (1.0, 0.35, 0.65), "cyan": (0.1, 0.7, 0.85), "purple": (0.45, 0.15, 0.65),
    "lime": (0.75, 0.95, 0.1), "navy": (0.06, 0.1, 0.35), "maroon": (0.45, 0.05, 0.12), "gold": (0.8, 0.62, 0.25),
}  # fmt: skip
"""Saturated colors, in sRGB."""


@dataclass(frozen=True)
class BallRanges:
    """Section [ball_design]: which designs there are, and how often."""

    kinds: tuple[str, ...] = some_of(
        tuple(KINDS),
        "patterns to draw from; one listed twice comes twice as often",
        (*KINDS, *("classic",) * 4, *("panels", "pinwheel", "tango", "mosaic", "plain", "triangles", "stars") * 2),
    )
    white: float = share(0.65, "designs on a white base; the others are on a saturated color or on black")
    hues: tuple[str, ...] = some_of(tuple(HUES), "saturated colors; one listed twice comes twice as often")
    dark: float = share(0.2, "designs on a black base, of those that aren't on white")
    black: float = share(0.5, "designs with black ink; the others' is saturated or dark gray")
    bright: float = share(0.06, "over-exposed designs: all albedo near 1, hardly any contrast")
    marked: float = share(0.4, "designs with small printed marks over the pattern")
    worn: float = share(0.45, "designs with wear")
    wear: tuple[float, float] = range_of(
        0.05, 0.9, "wear of the worn designs: dirt, scratches, lost ink", limits=(0.0, 1.0)
    )
    roughness: tuple[float, float] = range_of(0.08, 0.9, "roughness of the surface", limits=(0.05, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


def _linear(color: Floats) -> Color:
    red, green, blue = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4).tolist()
    return red, green, blue


def _saturated(random: np.random.Generator, hues: tuple[str, ...]) -> Color:
    color = np.array(HUES[str(random.choice(hues))]) * random.uniform(0.75, 1.05) + random.uniform(-0.06, 0.06, 3)
    return _linear(np.clip(color, 0.01, 0.99))


def _gray(random: np.random.Generator, low: float, high: float) -> Color:
    return _linear(np.clip(random.uniform(low, high) + random.uniform(-0.02, 0.02, 3), 0.01, 0.99))


def _scaled(color: Color, factor: float, offset: float = 0.0) -> Color:
    red, green, blue = (factor * each + offset for each in color)
    return red, green, blue


def draw_design(random: np.random.Generator, ranges: BallRanges) -> BallDesign:
    """A design by chance."""
    kind = str(random.choice(ranges.kinds))
    white = random.random() < ranges.white
    if white:
        base = _gray(random, 0.85, 0.98)
    else:
        base = _gray(random, 0.05, 0.2) if random.random() < ranges.dark else _saturated(random, ranges.hues)
    if random.random() < ranges.black:
        # Black on black would show no pattern.
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


def _mix(texture: Singles, color: Color, mask: Singles) -> None:
    for channel, value in zip(texture, color, strict=True):
        channel += (np.float32(value) - channel) * mask


def paint(design: BallDesign, height: int = 512) -> Singles:
    """Albedo texture (height, 2 height, 3) in linear RGB, 0..1.

    The center of pixel (column, row) is the direction (sin p cos a, sin p sin a, cos p) with the polar angle
    p = pi (row + 0.5) / height and the azimuth a = pi (column + 0.5) / height: row 0 is at the pole z = 1.
    """
    sphere = Sphere(directions_of(height))
    texture = np.empty_like(sphere.directions)
    texture[:] = np.array(design.base, np.float32)[:, None, None]
    ink, accent, seams = KINDS[design.kind](sphere, design)
    worn = _wear(sphere, design) if design.wear else None
    for color, mask in ((design.ink, ink), (design.accent, accent)):
        _mix(texture, color, mask if worn is None else mask * worn[0])
    if design.marks:
        random = design.random(1)
        centers, turns = unit(random.normal(size=(design.marks, 3))), random.uniform(0.0, 6.28, design.marks)
        images = [word(random) if random.random() < 0.5 else logo(random) for _ in centers]
        _mix(texture, design.ink, print_images(sphere, centers, random.uniform(0.12, 0.35), images, turns))
    _mix(texture, design.seam_color, seams)
    if worn is not None:
        _mix(texture, design.dirt, worn[1])
    return np.ascontiguousarray(np.moveaxis(np.clip(texture, 0.0, 1.0, out=texture), 0, 2))


def _wear(sphere: Sphere, design: BallDesign) -> tuple[Singles, Singles]:
    """What of the print is left, and how much dirt covers the ball: (height, width) each, 0..1."""
    random, wear = design.random(2), np.float32(design.wear)
    # Few waves of one length would show as a weave.
    coarse, middle, fine = (sphere.noise(random, *each) for each in ((3.5, 10), (15.0, 16), (45.0, 24)))
    rough = 0.55 * coarse + 0.35 * middle + 0.45 * fine
    left = (1.0 - random.uniform(0.0, 0.5) * wear) * np.clip(2.6 - 1.2 * wear - rough, 0.0, 1.0)
    dirt = np.clip(0.25 * (rough + coarse) + 0.7 * wear - 0.6, 0.0, 0.6) + random.uniform(0.0, 0.25) * wear
    for _ in range(int(10 * wear)):
        along = sphere.dot(unit(random.normal(size=3)))
        scratch = sphere.line(sphere.dot(unit(random.normal(size=3))) - np.float32(random.uniform(-0.8, 0.8)), 0.012)
        dirt = np.maximum(dirt, scratch * np.clip(8.0 * along - 6.5, 0.0, 0.6))
    return np.asarray(left, np.float32), np.asarray(np.clip(dirt, 0.0, 0.9), np.float32)


def white_share(design: BallDesign, height: int = 64) -> float:
    """Share of the ball's area that is white, 0..1."""
    texture = paint(design, height)
    low, high = texture.min(axis=2), texture.max(axis=2)
    white = (low > WHITE_ALBEDO) & (high - low < WHITE_CHROMA * high)
    weight = np.sin((np.arange(height) + 0.5) * math.pi / height)
    return float(white.mean(axis=1) @ weight / weight.sum())
