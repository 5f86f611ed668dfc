"""The soccer field: where its lines are, and how grass and paint look from a pixel's distance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import log_uniform, range_of, some_of, uniform

TURFS = ("blades", "felt", "natural")

_TILE = 1.024  # [m], of 1024 texels
_PATCHES = 6.0  # [m], of the tile of slow changes
_DEVIATION = 0.32  # of the ground from its mean color


@dataclass(frozen=True)
class FieldRanges:
    """Section [field]."""

    length: tuple[float, float] = range_of(5.0, 14.0, "length of a field; 9 x 6 m is the authors'", "m", (1.0, 120.0))
    proportion: tuple[float, float] = range_of(0.6, 0.75, "width of a field, in lengths", "", (0.3, 1.0))
    line_width: tuple[float, float] = range_of(0.045, 0.085, "width of lines", "m", (0.01, 0.5))
    border: tuple[float, float] = range_of(0.3, 2.0, "carpet beyond the outer lines", "m", (0.0, 20.0))
    endless: float = share(0.25, "fields whose grass goes on to the horizon")
    turfs: tuple[str, ...] = some_of(TURFS, "kinds of ground")
    hue: tuple[float, float] = range_of(60.0, 165.0, "hue of the grass; 120 is green", "deg", (0.0, 360.0))
    saturation: tuple[float, float] = range_of(0.5, 1.0, "saturation of the grass, in linear light", "", (0.0, 1.0))
    albedo: tuple[float, float] = range_of(0.05, 0.3, "brightness of the grass", "", (0.01, 0.95))
    odd_colors: float = share(0.08, "fields of any other color")
    texture: tuple[float, float] = range_of(0.4, 1.3, "strength of blades and patches", "", (0.0, 2.0))
    stripes: float = share(0.2, "fields that are mown in stripes")
    paint: tuple[float, float] = range_of(0.45, 0.9, "albedo of lines", "", (0.1, 1.0))
    cover: tuple[float, float] = range_of(
        0.3, 1.0, "how much of the ground paint covers; the rest shows", "", (0.0, 1.0)
    )
    thin: float = share(0.5, "fields whose paint does not cover fully")
    wear: tuple[float, float] = range_of(0.0, 0.6, "share of paint that is worn off", "", (0.0, 1.0))
    goal_height: tuple[float, float] = range_of(0.8, 2.0, "height of goals", "m", (0.2, 3.0))
    goal_width: tuple[float, float] = range_of(1.4, 3.0, "width of goals", "m", (0.3, 8.0))
    goals: float = share(0.85, "fields with goals")

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Field:
    """A field: measures [m], its middle (2,) and heading [rad] in the world, and its looks.

    border is infinite where grass goes on to the horizon. grass: linear RGB albedo (3,).
    """

    length: float
    width: float
    line_width: float
    border: float
    middle: tuple[float, float]
    heading: float
    turf: str
    grass: tuple[float, float, float]
    texture: float
    stripe: float
    paint: float
    cover: float
    wear: float
    seed: int

    @property
    def rotation(self) -> Floats:
        """From the field's frame, x along its length, to the world's, (2, 2)."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return np.array([[c, -s], [s, c]])

    def on_carpet(self, spot: Floats, margin: float = 0.0) -> bool:
        """Whether a place (2,) of the world is on the carpet, at least a margin [m] from its edge."""
        x, y = np.abs((spot - np.array(self.middle)) @ self.rotation) + margin
        return bool(x < self.length / 2.0 + self.border and y < self.width / 2.0 + self.border)


def draw_field(random: np.random.Generator, ranges: FieldRanges) -> Field:
    """A field with the camera, which is at the world's origin, somewhere on it or near it."""
    length = uniform(random, ranges.length)
    width = length * uniform(random, ranges.proportion)
    border = math.inf if random.random() < ranges.endless else uniform(random, ranges.border)
    heading = random.uniform(-np.pi, np.pi)
    place = random.uniform(-0.5, 0.5, 2) * (length, width)
    c, s = math.cos(heading), math.sin(heading)
    return Field(
        length=length,
        width=width,
        line_width=uniform(random, ranges.line_width),
        border=border,
        middle=(float(-c * place[0] + s * place[1]), float(-s * place[0] - c * place[1])),
        heading=float(heading),
        turf=str(random.choice(ranges.turfs)),
        grass=_grass(random, ranges),
        texture=uniform(random, ranges.texture),
        stripe=random.uniform(0.4, 1.5) if random.random() < ranges.stripes else 0.0,
        paint=uniform(random, ranges.paint),
        cover=uniform(random, ranges.cover) if random.random() < ranges.thin else 1.0,
        wear=uniform(random, ranges.wear) * float(random.random() < 0.5),
        seed=int(random.integers(1 << 31)),
    )


def _grass(random: np.random.Generator, ranges: FieldRanges) -> tuple[float, float, float]:
    odd = random.random() < ranges.odd_colors
    hue = random.uniform(0.0, 360.0) if odd else uniform(random, ranges.hue)
    saturation = random.uniform(0.0, 0.6) if odd else uniform(random, ranges.saturation)
    pixel = np.array([[[hue, saturation, 1.0]]], dtype=np.float32)
    color = cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0].astype(np.float64)
    color *= log_uniform(random, ranges.albedo) / (color @ (0.21, 0.72, 0.07))
    red, green, blue = np.minimum(color, 0.9)
    return float(red), float(green), float(blue)


def paint_ground(field: Field, points: Floats, range_: Floats, pixel: float) -> tuple[Singles, Singles, Singles]:
    """Albedo (h, w, 3), share of lines and share of carpet (h, w) at the places that a picture's pixels see.

    points: (h, w, 2) on the plane [m], infinite above the horizon; range_: their distances (h, w) from the camera [m];
    pixel: the angle between two pixels [rad]. Edges and texture are as sharp as the pixels allow.
    """
    seen = np.isfinite(points[..., 0])
    local = (np.where(seen[..., None], points, 1e6) - np.array(field.middle)) @ field.rotation
    x, y = local[..., 0], local[..., 1]
    if math.isinf(field.border):
        carpet = seen.astype(np.float32)
    else:
        carpet = _inside(field.length / 2.0 + field.border - np.abs(x))
        carpet *= _inside(field.width / 2.0 + field.border - np.abs(y)) * seen
    lines = _lines(field, x, y) * seen
    slow = _slow(field.seed, points)
    if field.wear:
        lines = lines * (1.0 - np.clip(4.0 * (field.wear - 0.5 + 5.0 * slow[..., 1]), 0.0, 0.95))

    footprint = np.where(seen, range_ * pixel, 1.0)
    grain = _grain(field.turf, field.seed % 3, points, footprint)
    grass = np.array(field.grass, dtype=np.float32) * (1.0 + field.texture * (grain + slow))
    if field.stripe:
        shade = 0.5 + np.clip(np.sin(np.pi * x / field.stripe) / _slope(np.pi * x / field.stripe), -0.5, 0.5)
        grass *= (0.88 + 0.24 * shade[..., None]).astype(np.float32)
    paint = field.paint * (1.0 + 0.3 * field.texture * grain.mean(axis=-1, keepdims=True))
    # Where paint is thin the upper ends of the blades take it, the dark ground between them does not.
    covering = np.clip(field.cover + (1.0 - field.cover) * 2.0 * grain, 0.0, 1.0)
    albedo = grass + lines[..., None] * covering * (paint - grass)
    return np.clip(albedo, 0.01, 0.95).astype(np.float32), lines.astype(np.float32), carpet.astype(np.float32)


def ground_noise(points: Floats, footprint: Floats, seed: int) -> Singles:
    """Grain (h, w, 1) of deviation about 1 at places (h, w, 2) of the plane, as pixels of a footprint (h, w) see it."""
    grain = _grain("natural", seed % 3, points, footprint).mean(axis=-1, keepdims=True)
    return np.asarray(grain / _DEVIATION, dtype=np.float32)


def _slope(distance: Floats) -> Floats:
    """How much a distance (h, w) changes from pixel to pixel, the less of both sides: beyond one may be the sky."""
    change = np.hypot(_change(distance), _change(distance.T).T)
    return np.asarray(np.maximum(change, 1e-9))


def _change(distance: Floats) -> Floats:
    step = np.abs(np.diff(distance, axis=0))
    return np.asarray(np.minimum(np.concatenate([step[:1], step]), np.concatenate([step, step[-1:]])))


def _inside(distance: Floats) -> Singles:
    """Share of each pixel on the positive side of an edge, from the signed distances (h, w) of pixel centers."""
    return np.asarray(np.clip(0.5 + distance / _slope(distance), 0.0, 1.0), dtype=np.float32)


def _band(distance: Floats, width: float) -> Singles:
    """Share of each pixel that is within half a width of a curve, from signed distances (h, w)."""
    half = np.minimum(_slope(distance), 1e6) / 2.0
    over = np.minimum(distance + half, width / 2.0) - np.maximum(distance - half, -width / 2.0)
    return np.asarray(np.clip(over, 0.0, None) / (2.0 * half), dtype=np.float32)


def _lines(field: Field, x: Floats, y: Floats) -> Singles:
    """Share (h, w) of lines: outline, half line, center circle, goal and penalty areas and marks."""
    half_length, half_width, line = field.length / 2.0, field.width / 2.0, field.line_width
    ax, ay = np.abs(x), np.abs(y)
    lines = np.maximum(_frame(ax, ay, half_length, half_width, line), _band(x, line) * _inside(half_width - ay))
    around = np.hypot(x, y)
    np.maximum(lines, _band(around - field.length / 12.0, line), out=lines)
    for depth, breadth in ((field.length / 9.0, field.width / 2.0), (field.length / 4.5, field.width / 1.2)):
        # An area's frame, shifted so that its outer side lies on the goal line.
        area = _frame(np.abs(ax - half_length + depth / 2.0), ay, depth / 2.0, breadth / 2.0, line)
        np.maximum(lines, area, out=lines)
    for mark in (np.hypot(ax - half_length + field.length / 6.0, y), around):
        np.maximum(lines, _inside(line - mark), out=lines)
    return np.asarray(lines)


def _frame(ax: Floats, ay: Floats, half_length: float, half_width: float, line: float) -> Singles:
    sides = _band(ax - half_length, line) * _inside(half_width + line / 2.0 - ay)
    ends = _band(ay - half_width, line) * _inside(half_length + line / 2.0 - ax)
    return np.asarray(np.maximum(sides, ends))


@lru_cache(maxsize=9)
def _turf(kind: str, variant: int) -> list[Singles]:
    """Deviation (n, n, 3) of a meter of ground from its mean color, at 1, 2, 4, ... mm a texel."""
    random = np.random.default_rng([TURFS.index(kind), variant])
    n = 1024
    if kind == "felt":
        texels = 0.25 * random.standard_normal((n, n, 1), dtype=np.float32)
        texels = texels + 0.5 * cv2.GaussianBlur(random.standard_normal((n, n, 3), dtype=np.float32), (0, 0), 2.0)
    else:
        texels = _blades(random, n, 26000, 9.0 if kind == "blades" else 16.0)
        if kind == "natural":
            patches = 0.25 * _fractal(random, n, 12.0)[..., None]
            texels = texels + patches * np.array([1.0, 0.8, 0.7], dtype=np.float32)
    texels = texels - texels.mean(axis=(0, 1))
    texels *= _DEVIATION / texels.std()
    levels = [texels.astype(np.float32)]
    while len(levels[-1]) > 1:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return levels


def _blades(random: np.random.Generator, n: int, count: int, length: float) -> Singles:
    """Blades of grass [px] over dark ground, (n, n, 3), without a seam."""
    ground = np.full((n, n, 3), -0.6, dtype=np.float32)
    starts = random.uniform(0, n, (count, 2))
    heading = random.uniform(0, 2.0 * np.pi, count)
    reach = length * random.uniform(0.5, 1.5, count)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    shade = random.normal(0.0, 0.45, count)[:, None] + random.normal(0.0, 0.12, (count, 3))
    for start, end, color in zip(starts, starts + reach, shade.tolist(), strict=True):
        for shift in {(0, 0), *_shifts(end, n)}:
            first, last = start - np.array(shift) * n, end - np.array(shift) * n
            cv2.line(ground, (int(first[0]), int(first[1])), (int(last[0]), int(last[1])), color, 1)
    return ground


def _shifts(end: Floats, n: int) -> list[tuple[int, int]]:
    x, y = (int(each) for each in np.floor(end / n))
    return [(x, y), (x, 0), (0, y)]


def _fractal(random: np.random.Generator, n: int, largest: float) -> Singles:
    """Smooth noise (n, n) of deviation 1 without a seam, with features up to n / largest."""
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.fftfreq(n)[None]) * n
    spectrum = np.fft.fft2(random.standard_normal((n, n)))
    noise = np.fft.ifft2(spectrum / np.maximum(frequency, largest) ** 1.6 * (frequency > 0)).real
    return np.asarray(noise / noise.std(), dtype=np.float32)


def _grain(kind: str, variant: int, points: Floats, footprint: Floats) -> Singles:
    """Deviation (h, w, 3) of the ground at points (h, w, 2), as fine as pixels of this footprint (h, w) [m] see it."""
    levels = _turf(kind, variant)
    starts = np.cumsum([0] + [len(level) ** 2 for level in levels])
    table = _flat(kind, variant)
    level = np.clip(np.log2(np.maximum(footprint, 1e-9) / (_TILE / 1024)) + 0.5, 0, len(levels) - 1).astype(np.intp)
    n = 1024 >> level
    safe = np.where(np.isfinite(points), points, 0.0)
    place = np.floor(np.mod(safe / _TILE, 1.0) * n[..., None]).astype(np.intp) % n[..., None]
    return np.asarray(table[starts[level] + place[..., 1] * n + place[..., 0]])


@lru_cache(maxsize=9)
def _flat(kind: str, variant: int) -> Singles:
    return np.concatenate([level.reshape(-1, 3) for level in _turf(kind, variant)])


@lru_cache(maxsize=4)
def _clouds(variant: int) -> Singles:
    random = np.random.default_rng([7, variant])
    shade, tint = (_fractal(random, 512, 2.0) for _ in range(2))
    return np.stack([0.1 * shade + 0.05 * tint, 0.1 * shade, 0.1 * shade - 0.03 * tint], axis=-1)


def _slow(seed: int, points: Floats) -> Singles:
    """Slow changes (h, w, 3) of the ground over a few meters, deviation about 0.1."""
    noise = _clouds(seed % 4)
    shift = np.random.default_rng(seed).uniform(0.0, 1.0, 2)
    place = np.mod(np.where(np.isfinite(points), points, 0.0) / _PATCHES + shift, 1.0) * len(noise)
    x, y = place[..., 0].astype(np.float32), place[..., 1].astype(np.float32)
    return np.asarray(cv2.remap(noise, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), dtype=np.float32)
