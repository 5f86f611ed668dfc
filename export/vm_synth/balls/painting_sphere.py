"""The sphere that textures are painted on: directions, edges, noise, panels and stamps, all without poles and seams."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Number, Singles, frozen

Shape = Callable[[Number, Number, int], Singles]
"""A printed shape: the mask at x, y [rad] from the center that has this number."""


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
        coarse = directions_of(height // factor, border)
        total = np.zeros(coarse.shape[1:], np.float32)
        for _ in range(waves):
            wave = unit(random.normal(size=3)) * frequency * random.uniform(0.3, 1.3)
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
            x_axis = unit(np.roll(center, 1) - center * (np.roll(center, 1) @ center) + 1e-9)
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
def directions_of(height: int, border: int = 0) -> Singles:
    """Directions (3, height, 2 height) of an equirectangular texture; a border goes on beyond poles and wrap."""
    polar = (np.arange(-border, height + border) + 0.5)[:, None] * math.pi / height
    around = (np.arange(-border, 2 * height + border) + 0.5)[None] * math.pi / height
    across = np.sin(polar)
    z = np.broadcast_to(np.cos(polar), (across.shape[0], around.shape[1]))
    return frozen(np.stack([across * np.cos(around), across * np.sin(around), z]).astype(np.float32))


def unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@lru_cache(maxsize=64)
def spread(count: int) -> Floats:
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
        half = np.concatenate([unit(part) for part in solids[count]])
        return frozen(np.concatenate([half, -half]))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    return frozen(np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1))
