"""Paints: linear albedo and roughness of common materials."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np

Color = tuple[float, float, float]
"""Linear RGB, 0 to 1."""

_SKINS = ((0.70, 0.45, 0.34), (0.58, 0.33, 0.23), (0.42, 0.22, 0.13), (0.22, 0.11, 0.06), (0.09, 0.04, 0.025))
_TEAMS = ((0.75, 0.02, 0.02), (0.02, 0.06, 0.65), (0.02, 0.55, 0.70), (0.70, 0.03, 0.45), (0.80, 0.55, 0.02))


@dataclass(frozen=True)
class Paint:
    """Linear albedo and roughness (0.05 to 1) of a surface."""

    color: Color
    roughness: float


def hued(hue: float, saturation: float, value: float, roughness: float) -> Paint:
    """A paint with this hue, saturation and value, each 0 to 1, of the linear color."""
    return Paint(colorsys.hsv_to_rgb(hue % 1.0, saturation, value), roughness)


def white(random: np.random.Generator) -> Paint:
    """White plastic, paper or paint, slightly tinted."""
    return _near_gray(random, (0.55, 0.9), 0.05, (0.15, 0.9))


def gray(random: np.random.Generator) -> Paint:
    """Gray plastic."""
    return _near_gray(random, (0.08, 0.45), 0.08, (0.2, 0.9))


def black(random: np.random.Generator) -> Paint:
    """Black plastic or rubber."""
    return _near_gray(random, (0.012, 0.06), 0.15, (0.12, 0.8))


def metal(random: np.random.Generator) -> Paint:
    """Brushed or anodized metal, without reflections."""
    return _near_gray(random, (0.2, 0.6), 0.06, (0.08, 0.4))


def glass(random: np.random.Generator) -> Paint:
    """A dark screen or lens."""
    return _near_gray(random, (0.01, 0.03), 0.3, (0.05, 0.1))


def vivid(random: np.random.Generator) -> Paint:
    """A saturated color of any hue."""
    return hued(random.uniform(), random.uniform(0.6, 0.98), random.uniform(0.15, 0.8), random.uniform(0.1, 0.9))


def cloth(random: np.random.Generator) -> Paint:
    """Clothes: jeans, black, gray or any color; rough."""
    kind = random.choice(4, p=[0.3, 0.25, 0.15, 0.3])
    rough = random.uniform(0.75, 1.0)
    if kind == 0:
        return hued(random.uniform(0.57, 0.66), random.uniform(0.4, 0.8), random.uniform(0.04, 0.3), rough)
    drawn = (black, gray, vivid)[kind - 1](random)
    return Paint(drawn.color, rough)


def skin(random: np.random.Generator) -> Paint:
    """Human skin."""
    red, green, blue = (channel * random.uniform(0.9, 1.1) for channel in _SKINS[random.integers(len(_SKINS))])
    return Paint((red, green, blue), random.uniform(0.4, 0.65))


def wood(random: np.random.Generator) -> Paint:
    """Wood or cardboard."""
    return hued(random.uniform(0.06, 0.1), random.uniform(0.45, 0.75), random.uniform(0.2, 0.55), 0.7)


def team(random: np.random.Generator) -> Paint:
    """The color of a team."""
    return Paint(_TEAMS[random.integers(len(_TEAMS))], random.uniform(0.3, 0.95))


def common(random: np.random.Generator) -> Paint:
    """A common color: white, black or gray as often as a saturated color or wood."""
    return (white, white, gray, black, vivid, vivid, wood)[random.integers(7)](random)


def _near_gray(
    random: np.random.Generator, value: tuple[float, float], tint: float, roughness: tuple[float, float]
) -> Paint:
    """A slightly tinted gray, drawn from ranges of value and roughness. tint: largest saturation."""
    return hued(random.uniform(), random.uniform(0.0, tint), random.uniform(*value), random.uniform(*roughness))
