"""The soccer field of a scene: its size, its place and its colors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import log_uniform, range_of, some_of, uniform

TURFS = ("blades", "felt", "natural")


@dataclass(frozen=True)
class FieldRanges:
    """Section [field]: soccer fields."""

    length: tuple[float, float] = range_of(
        5.0, 14.0, "length of a field; that of the paper's authors is 9 x 6 m", "m", (1.0, 120.0)
    )
    proportion: tuple[float, float] = range_of(0.6, 0.75, "width of a field as a share of its length", "", (0.3, 1.0))
    line_width: tuple[float, float] = range_of(0.045, 0.085, "width of lines", "m", (0.01, 0.5))
    border: tuple[float, float] = range_of(0.3, 2.0, "width of the carpet outside of the outer lines", "m", (0.0, 20.0))
    endless: float = share(0.25, "share of fields with grass up to the horizon")
    turfs: tuple[str, ...] = some_of(TURFS, "kinds of turf")
    hue: tuple[float, float] = range_of(60.0, 165.0, "hue of the grass; 120 is green", "deg", (0.0, 360.0))
    saturation: tuple[float, float] = range_of(0.5, 1.0, "saturation of the grass, in linear light", "", (0.0, 1.0))
    albedo: tuple[float, float] = range_of(0.05, 0.3, "albedo of the grass", "", (0.01, 0.95))
    odd_colors: float = share(0.08, "share of fields with grass of any color")
    texture: tuple[float, float] = range_of(0.4, 1.3, "contrast of grass blades and patches", "", (0.0, 2.0))
    stripes: float = share(0.2, "share of fields with mowing stripes")
    paint: tuple[float, float] = range_of(0.45, 0.9, "albedo of lines", "", (0.1, 1.0))
    cover: tuple[float, float] = range_of(0.3, 1.0, "opacity of thin paint on lines", "", (0.0, 1.0))
    thin: float = share(0.5, "share of fields with thin paint")
    wear: tuple[float, float] = range_of(
        0.0, 0.6, "share of paint that is lost on worn lines; half of the fields have worn lines", "", (0.0, 1.0)
    )
    goal_height: tuple[float, float] = range_of(0.8, 2.0, "height of goals", "m", (0.2, 3.0))
    goal_width: tuple[float, float] = range_of(1.4, 3.0, "width of goals", "m", (0.3, 8.0))
    goals: float = share(0.85, "share of fields with goals")

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Field:
    """A field: sizes [m], its center (2,) [m] and heading [rad] in the world, and its appearance.

    border: width of the carpet outside of the lines, infinite for grass up to the horizon. grass: linear RGB albedo.
    stripe: width of the mowing stripes [m], 0 without stripes. cover: opacity of the paint.
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
        """Rotation (2, 2) from the field's frame, with x along its length, to the world."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return np.array([[c, -s], [s, c]])

    def on_carpet(self, spot: Floats, margin: float = 0.0) -> bool:
        """Whether a point (2,) [m] of the world is on the carpet, at least a margin [m] from its edge."""
        x, y = np.abs((spot - np.array(self.middle)) @ self.rotation) + margin
        return bool(x < self.length / 2.0 + self.border and y < self.width / 2.0 + self.border)


def line_segments(length: float, width: float) -> Floats:
    """The ends (n, 2, 2) [m] of the straight lines of a field, in its frame, with x along its length: outline, halfway
    line, goal and penalty areas. Lengths are in meters, of the middles of the lines."""
    x, y = length / 2.0, width / 2.0
    segments = [((-x, -y), (x, -y)), ((x, -y), (x, y)), ((x, y), (-x, y)), ((-x, y), (-x, -y)), ((0.0, -y), (0.0, y))]
    for depth, breadth in ((length / 9.0, width / 2.0), (length / 4.5, width / 1.2)):
        for goal in (-x, x):
            front, side = math.copysign(x - depth, goal), breadth / 2.0
            segments += [((goal, -side), (front, -side)), ((front, -side), (front, side))]
            segments.append(((front, side), (goal, side)))
    return np.array(segments)


def with_line_at(random: np.random.Generator, field: Field, spot: Floats, reach: float) -> Field:
    """The field, moved so that the middle of one of its straight lines is at most `reach` [m] from a spot (2,) [m] of
    the world."""
    ends = line_segments(field.length, field.width)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(*along.T)
    chosen = int(random.choice(len(ends), p=lengths / lengths.sum()))
    right = np.array([-along[chosen, 1], along[chosen, 0]]) / lengths[chosen]
    place = ends[chosen, 0] + random.random() * along[chosen] + random.uniform(-reach, reach) * right
    x, y = (spot - field.rotation @ place).tolist()
    return replace(field, middle=(x, y))


def draw_field(random: np.random.Generator, ranges: FieldRanges) -> Field:
    """Draw a field. The camera, above the world's origin, stands at a random place between its outer lines."""
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
        grass=_draw_grass_color(random, ranges),
        texture=uniform(random, ranges.texture),
        stripe=random.uniform(0.4, 1.5) if random.random() < ranges.stripes else 0.0,
        paint=uniform(random, ranges.paint),
        cover=uniform(random, ranges.cover) if random.random() < ranges.thin else 1.0,
        wear=uniform(random, ranges.wear) * float(random.random() < 0.5),
        seed=int(random.integers(1 << 31)),
    )


def _draw_grass_color(random: np.random.Generator, ranges: FieldRanges) -> tuple[float, float, float]:
    """Linear RGB albedo (3,) of the grass."""
    odd = random.random() < ranges.odd_colors
    hue = random.uniform(0.0, 360.0) if odd else uniform(random, ranges.hue)
    saturation = random.uniform(0.0, 0.6) if odd else uniform(random, ranges.saturation)
    pixel = np.array([[[hue, saturation, 1.0]]], dtype=np.float32)
    color = cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0].astype(np.float64)
    color *= log_uniform(random, ranges.albedo) / (color @ (0.21, 0.72, 0.07))
    red, green, blue = np.minimum(color, 0.9)
    return float(red), float(green), float(blue)
