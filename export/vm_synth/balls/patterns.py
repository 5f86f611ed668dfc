"""The patterns of balls.

A pattern is a pure function of the sphere and a design. It returns three masks: the ink, the accent color over it, and
the seams. No pattern uses rows and columns of the texture, so neither its edges nor the poles show.

The module is long because it holds all 33 patterns; each is a short function of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vm_embedded.arrays import Floats, Number, Singles

from .design import BallDesign
from .painting_sphere import PaintingSphere, normalized, spread_directions, texture_directions
from .prints import logo, print_images, word

Layers = tuple[Singles, Singles, Singles]
"""Masks (height, width) of ink, accent and seams, 0 to 1."""


def _truncated(design: BallDesign) -> Floats:
    """Centers (32, 3) of 12 pentagons and 20 hexagons. Their lengths set the size of the pentagons."""
    return np.concatenate([spread_directions(12) * (0.955 + 0.04 * design.size), spread_directions(20)])


def _panels(sphere: PaintingSphere, design: BallDesign, centers: Floats, groups: list[int]) -> Layers:
    ink, accent, inside = sphere.panels(centers, groups)
    seams = sphere.line(inside, design.seam) if design.seam else sphere.empty()
    return sphere.edge(ink), sphere.edge(accent), seams


def _seams(sphere: PaintingSphere, design: BallDesign, count: int) -> Singles:
    """Mask of the seams of a ball with this many panels."""
    return _panels(sphere, design, spread_directions(count), [0] * count)[2]


def classic(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _panels(sphere, design, _truncated(design), [1] * 12 + [0] * 20)


def mosaic(sphere: PaintingSphere, design: BallDesign) -> Layers:
    hexagons = design.random().choice([0, 1, 2], size=20, p=(0.5, 0.15, 0.35))
    return _panels(sphere, design, _truncated(design), [1] * 12 + hexagons.tolist())


def outlined(sphere: PaintingSphere, design: BallDesign) -> Layers:
    ink, _, inside = sphere.panels(_truncated(design), [1] * 12 + [0] * 20)
    width = 0.03 + 0.08 * design.size
    filled = sphere.edge(ink - 2.2 * width) if design.pick((0, 1)) else sphere.empty()
    return sphere.line(ink - 0.7 * width, width), filled, sphere.line(inside, design.seam)


def mesh(sphere: PaintingSphere, design: BallDesign) -> Layers:
    ink, _, inside = sphere.panels(_truncated(design), [1] * 12 + [0] * 20)
    return sphere.line(inside, 0.03 + 0.07 * design.size), sphere.edge(ink - 0.12), sphere.empty()


def tango(sphere: PaintingSphere, design: BallDesign) -> Layers:
    near = np.max([np.abs(sphere.cosine_to(axis)) for axis in spread_directions(12)[:6]], axis=0)
    outside = np.arccos(np.minimum(near, 1.0)) - np.float32(0.52 + 0.07 * design.size)
    ring = sphere.line(outside - 0.02, 0.02)
    return sphere.edge(outside), ring, outlined(sphere, replace(design, seam=0.5 * design.seam))[2]


def panels(sphere: PaintingSphere, design: BallDesign) -> Layers:
    centers = spread_directions(design.pick((6, 8, 12, 14, 20)))
    groups = design.random().choice([0, 1, 2], size=len(centers), p=(0.55, 0.3, 0.15)).tolist()
    return _panels(sphere.warped(centers, 0.5 * design.twist), design, centers, groups)


def pinwheel(sphere: PaintingSphere, design: BallDesign) -> Layers:
    centers = spread_directions(design.pick((6, 8, 12, 6)))
    _, _, inside = sphere.warped(centers, 0.5 * math.copysign(1.0, design.twist)).panels(centers, [0] * len(centers))
    width = 0.1 + 0.25 * design.size
    return sphere.line(inside, width), sphere.line(inside - 0.5 * width, 0.06), sphere.line(inside, design.seam)


def propellers(sphere: PaintingSphere, design: BallDesign) -> Layers:
    long = 0.35 + 0.3 * design.size
    centers = spread_directions(6)

    def blade(x: Number, y: Number, i: int) -> Singles:
        bend = x + np.float32(0.6 * design.twist) * y * y * np.sign(y) / long
        return sphere.edge(long - np.hypot(bend * 2.4 * (1.3 - 0.8 * np.minimum(np.abs(y) / long, 1.0)), y))

    ink = sphere.stamp(centers, 0.8, blade)
    inner = sphere.stamp(centers, 0.8, lambda x, y, i: blade(1.3 * x, 1.15 * y, i))
    return ink, inner * design.pick((0, 1)), _seams(sphere, design, 6)


def swirl(sphere: PaintingSphere, design: BallDesign) -> Layers:
    arms, z = 1 + design.pick((1, 2, 3, 4, 5)), sphere.directions[2]
    signal = np.sin(arms * sphere.azimuth() + np.float32(8.0 * design.twist) * z + np.float32(design.phase))
    depth = (signal - np.float32(1.2 * design.size - 0.6)) * np.sqrt(1.0 - z * z) / (arms + 4.0 * abs(design.twist))
    return sphere.edge(depth), sphere.line(depth, 0.05) * design.pick((0, 1)), sphere.empty()


def beach(sphere: PaintingSphere, design: BallDesign) -> Layers:
    half, z = design.pick((1, 2, 3, 4)), sphere.directions[2]
    turn, across = sphere.azimuth() * half, np.sqrt(1.0 - z * z) / half
    ink, other = sphere.edge(np.sin(2.0 * turn) * across * 0.5), sphere.edge(np.sin(turn) * across)
    cap = sphere.edge(np.abs(z) - np.float32(1.0 - 0.08 * design.size))
    seams = sphere.line(np.sin(2.0 * turn) * across * 0.5, design.seam)
    return ink * (1.0 - cap), np.maximum(other * (1.0 - ink), cap), seams * (1.0 - cap)


def waves(sphere: PaintingSphere, design: BallDesign) -> Layers:
    bands, bent = design.pick((4, 6, 8, 11)), sphere.noise(design.random(), 2.5) * np.float32(0.25 * design.twist)
    depth = (np.sin(bands * (sphere.directions[2] + bent) + np.float32(design.phase)) + 0.8 - 1.6 * design.size) / bands
    return sphere.edge(depth), sphere.line(depth, 0.04) * design.pick((0, 1)), sphere.empty()


def stripes(sphere: PaintingSphere, design: BallDesign) -> Layers:
    ink, accent, _ = waves(sphere, replace(design, twist=0.0))
    return ink, accent, _seams(sphere, design, design.pick((6, 12, 14)))


def belt(sphere: PaintingSphere, design: BallDesign) -> Layers:
    sway = np.float32(0.15 * design.twist) * np.sin(design.pick((2, 3)) * sphere.azimuth())
    height, half = np.abs(sphere.directions[2] + sway), 0.12 + 0.5 * design.size
    return sphere.edge(half - height), sphere.line(height - half - 0.08, 0.06), sphere.empty()


def halves(sphere: PaintingSphere, design: BallDesign) -> Layers:
    bent = sphere.noise(design.random(), 3.0) * np.float32(0.12 * design.twist)
    depth = sphere.directions[2] + bent + np.float32(0.6 * design.size - 0.3)
    return sphere.edge(depth), sphere.line(depth, 0.12 * design.size) * design.pick((0, 1)), sphere.empty()


def tennis(sphere: PaintingSphere, design: BallDesign) -> Layers:
    x, y, z = sphere.directions
    depth = 0.6 * (x * x - y * y) + np.float32(0.3 + 0.2 * design.twist) * z
    ink = sphere.edge(depth) if design.pick((0, 1)) else sphere.line(depth, 0.05 + 0.2 * design.size)
    return ink, sphere.line(depth, 0.05), sphere.empty()


def dots(sphere: PaintingSphere, design: BallDesign) -> Layers:
    centers = spread_directions(design.pick((12, 20, 32, 60, 90)))
    radius = (0.45 + 0.4 * design.size) * 1.75 / math.sqrt(len(centers))
    mask = sphere.stamp(centers, radius + 0.05, lambda x, y, i: sphere.edge(radius - np.hypot(x, y)))
    inner = sphere.stamp(centers, radius, lambda x, y, i: sphere.edge(0.55 * radius - np.hypot(x, y)))
    return mask, inner * design.pick((0, 1)), sphere.empty()


def splashes(sphere: PaintingSphere, design: BallDesign) -> Layers:
    random, count = design.random(), 8 + design.count
    centers, radii = normalized(random.normal(size=(count, 3))), random.uniform(0.04, 0.15 + 0.25 * design.size, count)

    def disk(x: Number, y: Number, i: int) -> Singles:
        return sphere.edge(radii[i] - np.hypot(x, y))

    cut = count * 2 // 3
    ink = sphere.stamp(centers[:cut], radii[:cut] + 0.05, disk)
    return ink, sphere.stamp(centers[cut:], radii[:-cut] + 0.05, disk), sphere.empty()


def confetti(sphere: PaintingSphere, design: BallDesign) -> Layers:
    random, count = design.random(), 30 + 2 * design.count
    centers, turns = normalized(random.normal(size=(count, 3))), random.uniform(0.0, math.pi, count)
    long, wide = 0.06 + 0.12 * design.size, 0.02 + 0.02 * design.size

    def stroke(x: Number, y: Number, i: int) -> Singles:
        along, aside = x * math.cos(turns[i]) + y * math.sin(turns[i]), y * math.cos(turns[i]) - x * math.sin(turns[i])
        return sphere.edge(wide - np.hypot(np.maximum(np.abs(along) - long, 0.0), aside))

    cut = count // 2
    return sphere.stamp(centers[:cut], 0.25, stroke), sphere.stamp(centers[cut:], 0.25, stroke), sphere.empty()


def rings(sphere: PaintingSphere, design: BallDesign) -> Layers:
    centers = spread_directions(design.pick((6, 8, 12, 20)))
    radius, wide = (0.6 + 0.5 * design.size) * 1.75 / math.sqrt(len(centers)), 0.05 + 0.1 * design.size
    mask = sphere.stamp(centers, radius + 0.15, lambda x, y, i: sphere.line(np.hypot(x, y) - radius, wide))
    inner = sphere.stamp(centers, radius, lambda x, y, i: sphere.edge(0.4 * radius - np.hypot(x, y)))
    return mask, inner * design.pick((0, 1, 1)), sphere.empty()


def _polygons(sphere: PaintingSphere, design: BallDesign, corners: int, waist: float, spin: float) -> Layers:
    """Stars with this number of corners. waist: inner over outer radius. spin: how much their arms bend."""
    centers = spread_directions(design.pick((8, 12, 20, 12)))
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


def triangles(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, 3, 0.5, 0.0)


def stars(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, 5, 0.42, 0.0)


def flames(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _polygons(sphere, design, design.pick((3, 4)), 0.25, 6.0 * design.twist)


def crescents(sphere: PaintingSphere, design: BallDesign) -> Layers:
    centers = spread_directions(design.pick((8, 14, 24)))
    radius = (0.5 + 0.4 * design.size) * 1.75 / math.sqrt(len(centers))

    def crescent(x: Number, y: Number, i: int) -> Singles:
        aside = np.hypot(x - 0.5 * radius * math.cos(design.phase + i), y - 0.5 * radius * math.sin(design.phase + i))
        return sphere.edge(np.minimum(radius - np.hypot(x, y), aside - 0.8 * radius))

    mask = sphere.stamp(centers, radius + 0.05, crescent)
    return mask, sphere.empty(), _seams(sphere, design, 8)


def blotches(sphere: PaintingSphere, design: BallDesign) -> Layers:
    frequency = 3.0 + 7.0 * abs(design.twist)
    depth = (sphere.noise(design.random(), frequency) - np.float32(1.6 * design.size - 0.8)) / frequency
    return sphere.edge(depth), sphere.line(depth, 0.03) * design.pick((0, 1)), sphere.empty()


def camouflage(sphere: PaintingSphere, design: BallDesign) -> Layers:
    random, frequency = design.random(), 4.0 + 7.0 * design.size
    ink, accent = (sphere.edge((sphere.noise(random, frequency) - 0.3) / np.float32(frequency)) for _ in range(2))
    return ink, accent, sphere.empty()


def checks(sphere: PaintingSphere, design: BallDesign) -> Layers:
    count, z = design.pick((2, 3, 4, 6)), sphere.directions[2]
    across = np.sqrt(1.0 - z * z)
    a = sphere.edge(np.sin(count * sphere.azimuth()) * across / count)
    b = sphere.edge(np.sin(count * np.arccos(z) + (0.0 if count % 2 else 0.5 * math.pi)) / count)
    return a + b - 2.0 * a * b, sphere.edge(np.abs(z) - 0.97), sphere.empty()


def pixels(sphere: PaintingSphere, design: BallDesign) -> Layers:
    fine = 3.0 + 5.0 * design.size
    table = design.random().choice([0, 1, 2], size=20**3, p=(0.5, 0.35, 0.15))
    lattice = texture_directions(sphere.directions.shape[1])
    layers = np.zeros((2, *lattice.shape[1:]), np.float32)
    # Four samples per pixel smooth the edges of the cubes.
    for nudge in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        x, y, z = ((lattice + 0.3 * sphere.texel * np.array(nudge, np.float32)[:, None, None]) * fine + 9.37).astype(
            np.int32
        )
        value = table[(x * 20 + y) * 20 + z]
        layers += [value == 1, value == 2]
    return layers[0] / 4.0, layers[1] / 4.0, sphere.empty()


def _printed(sphere: PaintingSphere, design: BallDesign, make: Callable[[np.random.Generator], Singles]) -> Layers:
    random, count = design.random(), design.pick((6, 8, 12, 14))
    turns, half = random.uniform(0.0, 2.0 * math.pi, count), (0.6 + 0.5 * design.size) * 1.6 / math.sqrt(count)
    ink, accent = (
        print_images(sphere, centers, half, [make(random), make(random)], turns)
        for centers in (spread_directions(count)[::2], spread_directions(count)[1::2])
    )
    return ink, accent, _seams(sphere, design, count)


def words(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _printed(sphere, design, word)


def logos(sphere: PaintingSphere, design: BallDesign) -> Layers:
    return _printed(sphere, design, logo)


def shards(sphere: PaintingSphere, design: BallDesign) -> Layers:
    random, count = design.random(), design.pick((9, 13, 18, 24))
    groups = random.choice([0, 1, 2], size=count, p=(0.5, 0.3, 0.2)).tolist()
    return _panels(sphere, design, normalized(random.normal(size=(count, 3))), groups)


def loops(sphere: PaintingSphere, design: BallDesign) -> Layers:
    random, wide = design.random(), 0.03 + 0.12 * design.size
    masks = [sphere.empty(), sphere.empty()]
    for i in range(design.pick((3, 4, 5, 6))):
        depth = sphere.cosine_to(normalized(random.normal(size=3))) - random.uniform(-0.5, 0.5) * abs(design.twist)
        masks[i % 2] = np.maximum(masks[i % 2], sphere.line(np.asarray(depth, np.float32), wide))
    return masks[0], masks[1], sphere.empty()


def gradient(sphere: PaintingSphere, design: BallDesign) -> Layers:
    ramp = np.clip(0.5 + sphere.directions[2] * np.float32(0.5 + 2.0 * design.size), 0.0, 1.0)
    return ramp * ramp * (3.0 - 2.0 * ramp), sphere.empty(), _seams(sphere, design, design.pick((6, 12, 14)))


def plain(sphere: PaintingSphere, design: BallDesign) -> Layers:
    count = design.pick((6, 12, 14, 20))
    return (
        sphere.empty(),
        sphere.empty(),
        _seams(sphere.warped(spread_directions(count), 0.4 * design.twist), design, count),
    )


PATTERNS: dict[str, Callable[[PaintingSphere, BallDesign], Layers]] = {
    pattern.__name__: pattern
    for pattern in (
        classic, mosaic, outlined, mesh, tango, panels, pinwheel, propellers, swirl, beach, waves, stripes, belt,
        halves, tennis, dots, splashes, confetti, rings, triangles, stars, flames, crescents, blotches, camouflage,
        checks, pixels, words, logos, shards, loops, gradient, plain,
    )
}  # fmt: skip
"""All patterns by name."""
