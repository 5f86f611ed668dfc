"""Balls: designs drawn by parameters and painted as textures, all computed from directions on the sphere.

A pattern is a pure function of the sphere and a design that gives three masks of 0..1: where the ink lies, where the
accent lies over it, and where the seams are. `KINDS` names them all. Neither the wrap-around nor the poles show in a
texture, since no pattern knows of rows and columns.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Number, Singles, frozen

from .ranges import check_entries, drawn, share, some_of, uniform

Color = tuple[float, float, float]
"""Albedo in linear RGB, each 0..1."""

Layers = tuple[Singles, Singles, Singles]
"""Masks (height, width) of ink, accent and seams, each 0..1."""

Shape = Callable[[Number, Number, int], Singles]
"""A printed shape: the mask at x, y [rad] from the center that has this number."""

WHITE_ALBEDO, WHITE_CHROMA = 0.45, 0.25
"""What counts as white: the darkest channel is above the first, the channels differ by less than the second."""

HUES = {
    "orange": (1.0, 0.45, 0.05), "yellow": (1.0, 0.88, 0.1), "red": (0.85, 0.08, 0.1), "blue": (0.08, 0.25, 0.8),
    "green": (0.1, 0.6, 0.2), "pink": (1.0, 0.35, 0.65), "cyan": (0.1, 0.7, 0.85), "purple": (0.45, 0.15, 0.65),
    "lime": (0.75, 0.95, 0.1), "navy": (0.06, 0.1, 0.35), "maroon": (0.45, 0.05, 0.12), "gold": (0.8, 0.62, 0.25),
}  # fmt: skip
"""Saturated colors, in sRGB."""


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


@dataclass(frozen=True)
class Sphere:
    """Unit directions (3, height, width) of a texture's pixels."""

    directions: Singles

    @property
    def texel(self) -> float:
        """Height of a pixel [rad]."""
        return math.pi / float(self.directions.shape[1])

    def edge(self, depth: Number) -> Singles:
        """1 inside and 0 outside of a border, from the depth inside it [rad]."""
        ramp = np.clip(depth * np.float32(0.6 / self.texel) + np.float32(0.5), 0.0, 1.0)
        return np.asarray(ramp * ramp * (3.0 - 2.0 * ramp))

    def line(self, depth: Number, width: float) -> Singles:
        """1 within a line of this width [rad] where the depth is 0."""
        return self.edge(np.float32(0.5 * width) - np.abs(depth))

    def dot(self, axis: Floats) -> Singles:
        """Cosine of the angle to a unit axis (3,)."""
        return np.asarray(np.tensordot(axis.astype(np.float32), self.directions, 1), np.float32)

    def azimuth(self) -> Singles:
        return np.asarray(np.arctan2(self.directions[1], self.directions[0]), np.float32)

    def none(self) -> Singles:
        return np.zeros(self.directions.shape[1:], np.float32)

    def warped(self, axes: Floats, twist: float) -> Sphere:
        """The sphere wrung around each of the axes (n, 3), smoothly: straight edges become pinwheels."""
        if not twist:
            return self
        pull = np.zeros_like(self.directions)
        for axis in axes[: len(axes) // 2]:
            square = self.dot(axis) ** 2
            strength = self.dot(axis) * (square if len(axes) < 12 else square * square)
            for part, along in zip(pull, axis, strict=True):
                part += np.float32(along * twist) * strength
        (x, y, z), (u, v, w) = self.directions, pull
        moved = np.stack([x + y * w - z * v, y + z * u - x * w, z + x * v - y * u])
        moved /= np.sqrt((moved * moved).sum(axis=0))
        return Sphere(moved)

    def noise(self, random: np.random.Generator, frequency: float, waves: int = 14) -> Singles:
        """Smooth noise of deviation 1, features of about 3 / frequency [rad]."""
        height = self.directions.shape[1]
        factor, border = (4 if frequency < 40.0 else 2, 2) if height % 4 == 0 and height >= 256 else (1, 0)
        coarse = _directions(height // factor, border)
        total = np.zeros(coarse.shape[1:], np.float32)
        for _ in range(waves):
            wave = _unit(random.normal(size=3)) * frequency * random.uniform(0.3, 1.3)
            total += np.sin(np.tensordot(wave.astype(np.float32), coarse, 1) + np.float32(random.uniform(0, 6.28)))
        total *= np.float32(math.sqrt(2.0 / waves))
        if factor == 1:
            return total
        fine = cv2.resize(total, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        return np.asarray(fine[border * factor : -border * factor, border * factor : -border * factor])

    def stamp(self, centers: Floats, reaches: Number, shape: Shape) -> Singles:
        """One mask of a shape at each of the centers (n, 3), up to `reaches` [rad] away: one for all or (n,)."""
        mask = self.none()
        for i, (center, reach) in enumerate(zip(centers, np.broadcast_to(reaches, len(centers)), strict=True)):
            polar = math.acos(np.clip(center[2], -1.0, 1.0))
            rows = slice(max(0, int((polar - reach) / self.texel) - 1), int((polar + reach) / self.texel) + 2)
            part = Sphere(self.directions[:, rows])
            cosine = np.tensordot(center.astype(np.float32), part.directions, 1)
            near = np.nonzero(cosine > math.cos(reach))
            x_axis = _unit(np.roll(center, 1) - center * (np.roll(center, 1) @ center) + 1e-9)
            points = part.directions[:, near[0], near[1]]
            stretch = np.arccos(np.minimum(cosine[near], 1.0)) / np.sqrt(np.maximum(1.0 - cosine[near] ** 2, 1e-12))
            x, y = np.stack([x_axis, np.cross(center, x_axis)]).astype(np.float32) @ points * stretch
            mask[rows][near] = np.maximum(mask[rows][near], shape(x, y, i))
        return mask

    def cells(self, centers: Floats, groups: list[int]) -> tuple[Singles, Singles, Singles]:
        """Panels around centers (n, 3): depth [rad] inside those of group 1, those of group 2, and inside any panel."""
        strongest = [np.full(self.directions.shape[1:], -2.0, np.float32) for _ in range(4)]
        second = strongest[3].copy()
        for center, group in zip(centers, groups, strict=True):
            cosine = self.dot(center)
            np.maximum(second, np.minimum(strongest[3], cosine), out=second)
            for which in (group, 3):
                np.maximum(strongest[which], cosine, out=strongest[which])
        apart = np.linalg.norm(centers[:, None] - centers, axis=2) + 9.0 * np.eye(len(centers))
        base, ink, accent, best = (each / np.float32(np.median(apart.min(axis=1))) for each in strongest)
        inside = best - second / np.float32(np.median(apart.min(axis=1)))
        return ink - np.maximum(base, accent), accent - np.maximum(base, ink), inside


@lru_cache(maxsize=6)
def _directions(height: int, border: int = 0) -> Singles:
    """Directions (3, height, 2 height) of an equirectangular texture; a border goes on beyond poles and wrap."""
    polar = (np.arange(-border, height + border) + 0.5)[:, None] * math.pi / height
    around = (np.arange(-border, 2 * height + border) + 0.5)[None] * math.pi / height
    across = np.sin(polar)
    z = np.broadcast_to(np.cos(polar), (across.shape[0], around.shape[1]))
    return frozen(np.stack([across * np.cos(around), across * np.sin(around), z]).astype(np.float32))


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@lru_cache(maxsize=64)
def _centers(count: int) -> Floats:
    """Evenly spread unit vectors (count, 3): faces of a regular solid where there is one, a spiral elsewhere.

    The second half of a solid's is opposite to the first.
    """
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    cube, corners = np.eye(3), np.array([(1, y, z) for y, z in product((1, -1), repeat=2)])
    vertices = np.array([(0, 1, golden), (1, golden, 0), (golden, 0, 1)])
    vertices = np.concatenate([vertices, vertices * [[1, 1, -1], [1, -1, 1], [-1, 1, 1]]])
    faces = np.array([(0, 1 / golden, golden), (1 / golden, golden, 0), (golden, 0, 1 / golden)])
    faces = np.concatenate([faces, faces * [[1, 1, -1], [1, -1, 1], [-1, 1, 1]], corners])
    solids = {6: [cube], 8: [corners], 12: [vertices], 14: [cube, corners], 20: [faces[:, [1, 0, 2]]]}
    solids[32] = solids[12] + solids[20]
    if count in solids:
        half = np.concatenate([_unit(part) for part in solids[count]])
        return frozen(np.concatenate([half, -half]))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    return frozen(np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1))


def _truncated(design: BallDesign) -> Floats:
    """Centers of 12 pentagons, then 20 hexagons; their lengths set the pentagons' size, 0.97 being the solid's."""
    return np.concatenate([_centers(12) * (0.955 + 0.04 * design.size), _centers(20)])


def _panels(sphere: Sphere, design: BallDesign, centers: Floats, groups: list[int]) -> Layers:
    ink, accent, inside = sphere.cells(centers, groups)
    seams = sphere.line(inside, design.seam) if design.seam else sphere.none()
    return sphere.edge(ink), sphere.edge(accent), seams


def _seams(sphere: Sphere, design: BallDesign, count: int) -> Singles:
    """Seams of a ball of this many panels."""
    return _panels(sphere, design, _centers(count), [0] * count)[2]


def classic(sphere: Sphere, design: BallDesign) -> Layers:
    return _panels(sphere, design, _truncated(design), [1] * 12 + [0] * 20)


def mosaic(sphere: Sphere, design: BallDesign) -> Layers:
    hexagons = design.random().choice([0, 1, 2], size=20, p=(0.5, 0.15, 0.35))
    return _panels(sphere, design, _truncated(design), [1] * 12 + hexagons.tolist())


def outlined(sphere: Sphere, design: BallDesign) -> Layers:
    ink, _, inside = sphere.cells(_truncated(design), [1] * 12 + [0] * 20)
    width = 0.03 + 0.08 * design.size
    filled = sphere.edge(ink - 2.2 * width) if design.pick((0, 1)) else sphere.none()
    return sphere.line(ink - 0.7 * width, width), filled, sphere.line(inside, design.seam)


def mesh(sphere: Sphere, design: BallDesign) -> Layers:
    ink, _, inside = sphere.cells(_truncated(design), [1] * 12 + [0] * 20)
    return sphere.line(inside, 0.03 + 0.07 * design.size), sphere.edge(ink - 0.12), sphere.none()


def tango(sphere: Sphere, design: BallDesign) -> Layers:
    near = np.max([np.abs(sphere.dot(axis)) for axis in _centers(12)[:6]], axis=0)
    outside = np.arccos(np.minimum(near, 1.0)) - np.float32(0.52 + 0.07 * design.size)
    ring = sphere.line(outside - 0.02, 0.02)
    return sphere.edge(outside), ring, outlined(sphere, replace(design, seam=0.5 * design.seam))[2]


def panels(sphere: Sphere, design: BallDesign) -> Layers:
    centers = _centers(design.pick((6, 8, 12, 14, 20)))
    groups = design.random().choice([0, 1, 2], size=len(centers), p=(0.55, 0.3, 0.15)).tolist()
    return _panels(sphere.warped(centers, 0.5 * design.twist), design, centers, groups)


def pinwheel(sphere: Sphere, design: BallDesign) -> Layers:
    centers = _centers(design.pick((6, 8, 12, 6)))
    _, _, inside = sphere.warped(centers, 0.5 * math.copysign(1.0, design.twist)).cells(centers, [0] * len(centers))
    width = 0.1 + 0.25 * design.size
    return sphere.line(inside, width), sphere.line(inside - 0.5 * width, 0.06), sphere.line(inside, design.seam)


def propellers(sphere: Sphere, design: BallDesign) -> Layers:
    long = 0.35 + 0.3 * design.size
    centers = _centers(6)

    def blade(x: Number, y: Number, i: int) -> Singles:
        bend = x + np.float32(0.6 * design.twist) * y * y * np.sign(y) / long
        return sphere.edge(long - np.hypot(bend * 2.4 * (1.3 - 0.8 * np.minimum(np.abs(y) / long, 1.0)), y))

    ink = sphere.stamp(centers, 0.8, blade)
    inner = sphere.stamp(centers, 0.8, lambda x, y, i: blade(1.3 * x, 1.15 * y, i))
    return ink, inner * design.pick((0, 1)), _seams(sphere, design, 6)


def swirl(sphere: Sphere, design: BallDesign) -> Layers:
    arms, z = 1 + design.pick((1, 2, 3, 4, 5)), sphere.directions[2]
    signal = np.sin(arms * sphere.azimuth() + np.float32(8.0 * design.twist) * z + np.float32(design.phase))
    depth = (signal - np.float32(1.2 * design.size - 0.6)) * np.sqrt(1.0 - z * z) / (arms + 4.0 * abs(design.twist))
    return sphere.edge(depth), sphere.line(depth, 0.05) * design.pick((0, 1)), sphere.none()


def beach(sphere: Sphere, design: BallDesign) -> Layers:
    half, z = design.pick((1, 2, 3, 4)), sphere.directions[2]
    turn, across = sphere.azimuth() * half, np.sqrt(1.0 - z * z) / half
    ink, other = sphere.edge(np.sin(2.0 * turn) * across * 0.5), sphere.edge(np.sin(turn) * across)
    cap = sphere.edge(np.abs(z) - np.float32(1.0 - 0.08 * design.size))
    seams = sphere.line(np.sin(2.0 * turn) * across * 0.5, design.seam)
    return ink * (1.0 - cap), np.maximum(other * (1.0 - ink), cap), seams * (1.0 - cap)


def waves(sphere: Sphere, design: BallDesign) -> Layers:
    bands, bent = design.pick((4, 6, 8, 11)), sphere.noise(design.random(), 2.5) * np.float32(0.25 * design.twist)
    depth = (np.sin(bands * (sphere.directions[2] + bent) + np.float32(design.phase)) + 0.8 - 1.6 * design.size) / bands
    return sphere.edge(depth), sphere.line(depth, 0.04) * design.pick((0, 1)), sphere.none()


def stripes(sphere: Sphere, design: BallDesign) -> Layers:
    ink, accent, _ = waves(sphere, replace(design, twist=0.0))
    return ink, accent, _seams(sphere, design, design.pick((6, 12, 14)))


def belt(sphere: Sphere, design: BallDesign) -> Layers:
    sway = np.float32(0.15 * design.twist) * np.sin(design.pick((2, 3)) * sphere.azimuth())
    height, half = np.abs(sphere.directions[2] + sway), 0.12 + 0.5 * design.size
    return sphere.edge(half - height), sphere.line(height - half - 0.08, 0.06), sphere.none()


def halves(sphere: Sphere, design: BallDesign) -> Layers:
    bent = sphere.noise(design.random(), 3.0) * np.float32(0.12 * design.twist)
    depth = sphere.directions[2] + bent + np.float32(0.6 * design.size - 0.3)
    return sphere.edge(depth), sphere.line(depth, 0.12 * design.size) * design.pick((0, 1)), sphere.none()


def tennis(sphere: Sphere, design: BallDesign) -> Layers:
    x, y, z = sphere.directions
    depth = 0.6 * (x * x - y * y) + np.float32(0.3 + 0.2 * design.twist) * z
    ink = sphere.edge(depth) if design.pick((0, 1)) else sphere.line(depth, 0.05 + 0.2 * design.size)
    return ink, sphere.line(depth, 0.05), sphere.none()


def dots(sphere: Sphere, design: BallDesign) -> Layers:
    centers = _centers(design.pick((12, 20, 32, 60, 90)))
    radius = (0.45 + 0.4 * design.size) * 1.75 / math.sqrt(len(centers))
    mask = sphere.stamp(centers, radius + 0.05, lambda x, y, i: sphere.edge(radius - np.hypot(x, y)))
    inner = sphere.stamp(centers, radius, lambda x, y, i: sphere.edge(0.55 * radius - np.hypot(x, y)))
    return mask, inner * design.pick((0, 1)), sphere.none()


def splashes(sphere: Sphere, design: BallDesign) -> Layers:
    random, count = design.random(), 8 + design.count
    centers, radii = _unit(random.normal(size=(count, 3))), random.uniform(0.04, 0.15 + 0.25 * design.size, count)

    def disk(x: Number, y: Number, i: int) -> Singles:
        return sphere.edge(radii[i] - np.hypot(x, y))

    cut = count * 2 // 3
    ink = sphere.stamp(centers[:cut], radii[:cut] + 0.05, disk)
    return ink, sphere.stamp(centers[cut:], radii[:-cut] + 0.05, disk), sphere.none()


def confetti(sphere: Sphere, design: BallDesign) -> Layers:
    random, count = design.random(), 30 + 2 * design.count
    centers, turns = _unit(random.normal(size=(count, 3))), random.uniform(0.0, math.pi, count)
    long, wide = 0.06 + 0.12 * design.size, 0.02 + 0.02 * design.size

    def stroke(x: Number, y: Number, i: int) -> Singles:
        along, aside = x * math.cos(turns[i]) + y * math.sin(turns[i]), y * math.cos(turns[i]) - x * math.sin(turns[i])
        return sphere.edge(wide - np.hypot(np.maximum(np.abs(along) - long, 0.0), aside))

    cut = count // 2
    return sphere.stamp(centers[:cut], 0.25, stroke), sphere.stamp(centers[cut:], 0.25, stroke), sphere.none()


def rings(sphere: Sphere, design: BallDesign) -> Layers:
    centers = _centers(design.pick((6, 8, 12, 20)))
    radius, wide = (0.6 + 0.5 * design.size) * 1.75 / math.sqrt(len(centers)), 0.05 + 0.1 * design.size
    mask = sphere.stamp(centers, radius + 0.15, lambda x, y, i: sphere.line(np.hypot(x, y) - radius, wide))
    inner = sphere.stamp(centers, radius, lambda x, y, i: sphere.edge(0.4 * radius - np.hypot(x, y)))
    return mask, inner * design.pick((0, 1, 1)), sphere.none()


def _polygons(sphere: Sphere, design: BallDesign, corners: int, waist: float, spin: float) -> Layers:
    """Stars: `waist` is the inner over the outer radius, and `spin` bends their arms."""
    centers = _centers(design.pick((8, 12, 20, 12)))
    outer = (0.6 + 0.6 * design.size) * 1.75 / math.sqrt(len(centers))
    step = math.pi / corners

    def star(x: Number, y: Number, i: int) -> Singles:
        radius = np.hypot(x, y)
        turn = np.abs((np.arctan2(y, x) + design.phase + spin * radius) % (2.0 * step) - step)
        border = outer * waist * math.sin(step) / (waist * np.sin(turn) + np.sin(step - turn))
        return sphere.edge((border - radius) * 0.7)

    inner = sphere.stamp(centers, outer, lambda x, y, i: star(1.7 * x, 1.7 * y, i))
    mask = sphere.stamp(centers, outer + 0.05, star)
    return mask, inner * design.pick((0, 0, 1)), _seams(sphere, design, len(centers))


def triangles(sphere: Sphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, 3, 0.5, 0.0)


def stars(sphere: Sphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, 5, 0.42, 0.0)


def flames(sphere: Sphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, design.pick((3, 4)), 0.25, 6.0 * design.twist)


def crescents(sphere: Sphere, design: BallDesign) -> Layers:
    centers = _centers(design.pick((8, 14, 24)))
    radius = (0.5 + 0.4 * design.size) * 1.75 / math.sqrt(len(centers))

    def crescent(x: Number, y: Number, i: int) -> Singles:
        aside = np.hypot(x - 0.5 * radius * math.cos(design.phase + i), y - 0.5 * radius * math.sin(design.phase + i))
        return sphere.edge(np.minimum(radius - np.hypot(x, y), aside - 0.8 * radius))

    mask = sphere.stamp(centers, radius + 0.05, crescent)
    return mask, sphere.none(), _seams(sphere, design, 8)


def blotches(sphere: Sphere, design: BallDesign) -> Layers:
    frequency = 3.0 + 7.0 * abs(design.twist)
    depth = (sphere.noise(design.random(), frequency) - np.float32(1.6 * design.size - 0.8)) / frequency
    return sphere.edge(depth), sphere.line(depth, 0.03) * design.pick((0, 1)), sphere.none()


def camouflage(sphere: Sphere, design: BallDesign) -> Layers:
    random, frequency = design.random(), 4.0 + 7.0 * design.size
    ink, accent = (sphere.edge((sphere.noise(random, frequency) - 0.3) / np.float32(frequency)) for _ in range(2))
    return ink, accent, sphere.none()


def checks(sphere: Sphere, design: BallDesign) -> Layers:
    count, z = design.pick((2, 3, 4, 6)), sphere.directions[2]
    across = np.sqrt(1.0 - z * z)
    a = sphere.edge(np.sin(count * sphere.azimuth()) * across / count)
    b = sphere.edge(np.sin(count * np.arccos(z) + (0.0 if count % 2 else 0.5 * math.pi)) / count)
    return a + b - 2.0 * a * b, sphere.edge(np.abs(z) - 0.97), sphere.none()


def pixels(sphere: Sphere, design: BallDesign) -> Layers:
    fine = 3.0 + 5.0 * design.size
    table = design.random().choice([0, 1, 2], size=20**3, p=(0.5, 0.35, 0.15))
    lattice = _directions(sphere.directions.shape[1])
    layers = np.zeros((2, *lattice.shape[1:]), np.float32)
    # Four samples a texel: the lattice has no depth to smooth its edges with.
    for nudge in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        x, y, z = ((lattice + 0.3 * sphere.texel * np.array(nudge, np.float32)[:, None, None]) * fine + 9.37).astype(
            np.int32
        )
        value = table[(x * 20 + y) * 20 + z]
        layers += [value == 1, value == 2]
    return layers[0] / 4.0, layers[1] / 4.0, sphere.none()


def _stamp_image(sphere: Sphere, centers: Floats, half: float, images: list[Singles], turns: Floats) -> Singles:
    """Images (size, size) of 0..1 printed at the centers (n, 3), each 2 * half [rad] wide and turned [rad]."""
    # Without a blur as wide as a texel a fine image would alias.
    blur = max(0.4 * sphere.texel * images[0].shape[0] / (2.0 * half), 0.3)
    images = [np.asarray(cv2.GaussianBlur(image, (0, 0), blur)) for image in images]

    def printed(x: Number, y: Number, i: int) -> Singles:
        image, cosine, sine = images[i % len(images)], math.cos(turns[i]), math.sin(turns[i])
        places = (
            (along / half + 1.0) * 0.5 * len(image) - 0.5 for along in (cosine * x + sine * y, sine * x - cosine * y)
        )
        # remap takes no more than 32767 columns.
        column, row = (np.resize(place, (len(x) // 1024 + 1, 1024)).astype(np.float32) for place in places)
        return np.asarray(cv2.remap(image, column, row, cv2.INTER_LINEAR), np.float32).ravel()[: len(x)]

    return sphere.stamp(centers, 1.4 * half, printed)


def _word(random: np.random.Generator) -> Singles:
    """A word or number (96, 96) of 0..1 in chance letters."""
    image = np.zeros((96, 96), np.uint8)
    text = "".join(random.choice(list("ABCDEFGHIKLMNOPRSTUVXYZ0123456789"), size=random.integers(1, 7)))
    font, thick = int(random.choice([0, 2, 3, 4])), int(random.integers(2, 7))
    (wide, high), _ = cv2.getTextSize(text, font, 1.0, thick)
    scale = min(84.0 / wide, 60.0 / high)
    corner = int(48 - 0.5 * wide * scale), int(48 + 0.5 * high * scale)
    cv2.putText(image, text, corner, font, scale, 255, thick, cv2.LINE_AA)
    return image.astype(np.float32) / 255.0


def _logo(random: np.random.Generator) -> Singles:
    """A mark (96, 96) of 0..1 of a few arcs, rings and polygons."""
    image = np.zeros((96, 96), np.uint8)
    for _ in range(random.integers(1, 4)):
        if random.random() < 0.5:
            column, row, wide, high = random.integers((34, 34, 12, 8), (62, 62, 32, 32)).tolist()
            thick, turn, end = random.integers((4, 0, 120), (14, 360, 361)).tolist()
            cv2.ellipse(image, (column, row), (wide, high), turn, 0, end, 255, thick, cv2.LINE_AA)
        else:
            corners = random.integers(16, 80, (random.integers(3, 6), 2)).astype(np.int32)
            cv2.fillPoly(image, [corners], 255, cv2.LINE_AA)
    return image.astype(np.float32) / 255.0


def _printed(sphere: Sphere, design: BallDesign, make: Callable[[np.random.Generator], Singles]) -> Layers:
    random, count = design.random(), design.pick((6, 8, 12, 14))
    turns, half = random.uniform(0.0, 2.0 * math.pi, count), (0.6 + 0.5 * design.size) * 1.6 / math.sqrt(count)
    ink, accent = (
        _stamp_image(sphere, centers, half, [make(random), make(random)], turns)
        for centers in (_centers(count)[::2], _centers(count)[1::2])
    )
    return ink, accent, _seams(sphere, design, count)


def words(sphere: Sphere, design: BallDesign) -> Layers:
    return _printed(sphere, design, _word)


def logos(sphere: Sphere, design: BallDesign) -> Layers:
    return _printed(sphere, design, _logo)


def shards(sphere: Sphere, design: BallDesign) -> Layers:
    random, count = design.random(), design.pick((9, 13, 18, 24))
    groups = random.choice([0, 1, 2], size=count, p=(0.5, 0.3, 0.2)).tolist()
    return _panels(sphere, design, _unit(random.normal(size=(count, 3))), groups)


def loops(sphere: Sphere, design: BallDesign) -> Layers:
    random, wide = design.random(), 0.03 + 0.12 * design.size
    masks = [sphere.none(), sphere.none()]
    for i in range(design.pick((3, 4, 5, 6))):
        depth = sphere.dot(_unit(random.normal(size=3))) - random.uniform(-0.5, 0.5) * abs(design.twist)
        masks[i % 2] = np.maximum(masks[i % 2], sphere.line(np.asarray(depth, np.float32), wide))
    return masks[0], masks[1], sphere.none()


def gradient(sphere: Sphere, design: BallDesign) -> Layers:
    ramp = np.clip(0.5 + sphere.directions[2] * np.float32(0.5 + 2.0 * design.size), 0.0, 1.0)
    return ramp * ramp * (3.0 - 2.0 * ramp), sphere.none(), _seams(sphere, design, design.pick((6, 12, 14)))


def plain(sphere: Sphere, design: BallDesign) -> Layers:
    count = design.pick((6, 12, 14, 20))
    return sphere.none(), sphere.none(), _seams(sphere.warped(_centers(count), 0.4 * design.twist), design, count)


KINDS: dict[str, Callable[[Sphere, BallDesign], Layers]] = {
    pattern.__name__: pattern
    for pattern in (
        classic, mosaic, outlined, mesh, tango, panels, pinwheel, propellers, swirl, beach, waves, stripes, belt,
        halves, tennis, dots, splashes, confetti, rings, triangles, stars, flames, crescents, blotches, camouflage,
        checks, pixels, words, logos, shards, loops, gradient, plain,
    )
}  # fmt: skip
"""All patterns by their names."""


@dataclass(frozen=True)
class BallRanges:
    """Section [ball_design]: which designs there are, and how often."""

    kinds: tuple[str, ...] = some_of(
        tuple(KINDS),
        "patterns to draw from; one listed twice comes twice as often",
        (*KINDS, *("classic",) * 4, *("panels", "pinwheel", "tango", "mosaic", "plain", "triangles", "stars") * 2),
    )
    white: float = share(0.65, "designs on a white base; the others are on a saturated color or on black")
    dark: float = share(0.2, "designs on a black base, of those that aren't on white")
    black: float = share(0.5, "designs with black ink; the others' is saturated or dark gray")
    bright: float = share(0.06, "over-exposed designs: all albedo near 1, hardly any contrast")
    marked: float = share(0.4, "designs with small printed marks over the pattern")
    worn: float = share(0.45, "designs with wear")
    wear: tuple[float, float] = drawn(
        0.05, 0.9, "wear of the worn designs: dirt, scratches, lost ink", limits=(0.0, 1.0)
    )
    roughness: tuple[float, float] = drawn(0.08, 0.9, "roughness of the surface", limits=(0.05, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


def _linear(color: Floats) -> Color:
    red, green, blue = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4).tolist()
    return red, green, blue


def _saturated(random: np.random.Generator) -> Color:
    color = np.array(HUES[str(random.choice(list(HUES)))]) * random.uniform(0.75, 1.05) + random.uniform(-0.06, 0.06, 3)
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
        base = _gray(random, 0.05, 0.2) if random.random() < ranges.dark else _saturated(random)
    if random.random() < ranges.black:
        # Black on black would show no pattern.
        ink = _gray(random, 0.04, 0.15) if max(base) > 0.06 else _gray(random, 0.85, 0.98)
    else:
        ink = _saturated(random) if random.random() < 0.8 else _gray(random, 0.2, 0.45)
    accent = _saturated(random) if random.random() < 0.65 else _gray(random, 0.05, 0.95)
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
    sphere = Sphere(_directions(height))
    texture = np.empty_like(sphere.directions)
    texture[:] = np.array(design.base, np.float32)[:, None, None]
    ink, accent, seams = KINDS[design.kind](sphere, design)
    worn = _wear(sphere, design) if design.wear else None
    for color, mask in ((design.ink, ink), (design.accent, accent)):
        _mix(texture, color, mask if worn is None else mask * worn[0])
    if design.marks:
        random = design.random(1)
        centers, turns = _unit(random.normal(size=(design.marks, 3))), random.uniform(0.0, 6.28, design.marks)
        images = [_word(random) if random.random() < 0.5 else _logo(random) for _ in centers]
        _mix(texture, design.ink, _stamp_image(sphere, centers, random.uniform(0.12, 0.35), images, turns))
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
        along = sphere.dot(_unit(random.normal(size=3)))
        scratch = sphere.line(sphere.dot(_unit(random.normal(size=3))) - np.float32(random.uniform(-0.8, 0.8)), 0.012)
        dirt = np.maximum(dirt, scratch * np.clip(8.0 * along - 6.5, 0.0, 0.6))
    return np.asarray(left, np.float32), np.asarray(np.clip(dirt, 0.0, 0.9), np.float32)


def white_share(design: BallDesign, height: int = 64) -> float:
    """Share of the ball's area that is white, 0..1."""
    texture = paint(design, height)
    low, high = texture.min(axis=2), texture.max(axis=2)
    white = (low > WHITE_ALBEDO) & (high - low < WHITE_CHROMA * high)
    weight = np.sin((np.arange(height) + 0.5) * math.pi / height)
    return float(white.mean(axis=1) @ weight / weight.sum())
