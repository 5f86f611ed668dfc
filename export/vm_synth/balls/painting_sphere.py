"""The sphere on which textures are painted: edges, lines, noise, panels and stamps.

All of them are functions of the direction, so neither the poles nor the edge of the texture show.
"""

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
"""A shape to stamp: its mask at x, y [rad] from the center with this number."""


@dataclass(frozen=True)
class PaintingSphere:
    """The unit directions (3, height, width) of a texture's pixels."""

    directions: Singles

    @property
    def texel(self) -> float:
        """Height of a pixel [rad]."""
        return math.pi / float(self.directions.shape[1])

    def edge(self, depth: Number) -> Singles:
        """Mask that is 1 inside and 0 outside of an edge. depth: distance from the edge [rad], positive inside."""
        ramp = np.clip(depth * np.float32(0.6 / self.texel) + np.float32(0.5), 0.0, 1.0)
        return np.asarray(ramp * ramp * (3.0 - 2.0 * ramp))

    def line(self, depth: Number, width: float) -> Singles:
        """Mask of a line of this width [rad]. depth: signed distance from its middle [rad]."""
        return self.edge(np.float32(0.5 * width) - np.abs(depth))

    def cosine_to(self, axis: Floats) -> Singles:
        """Cosine of the angle to a unit axis (3,)."""
        return np.asarray(np.tensordot(axis.astype(np.float32), self.directions, 1), np.float32)

    def azimuth(self) -> Singles:
        """Azimuth (height, width) [rad]."""
        return np.asarray(np.arctan2(self.directions[1], self.directions[0]), np.float32)

    def empty(self) -> Singles:
        """An empty mask (height, width)."""
        return np.zeros(self.directions.shape[1:], np.float32)

    def warped(self, axes: Floats, twist: float) -> PaintingSphere:
        """The sphere twisted smoothly around each of the axes (n, 3): straight edges become pinwheels."""
        if not twist:
            return self
        pull = np.zeros_like(self.directions)
        for axis in axes[: len(axes) // 2]:
            square = self.cosine_to(axis) ** 2
            strength = self.cosine_to(axis) * (square if len(axes) < 12 else square * square)
            for part, along in zip(pull, axis, strict=True):
                part += np.float32(along * twist) * strength
        (x, y, z), (u, v, w) = self.directions, pull
        moved = np.stack([x + y * w - z * v, y + z * u - x * w, z + x * v - y * u])
        moved /= np.sqrt((moved * moved).sum(axis=0))
        return PaintingSphere(moved)

    def noise(self, random: np.random.Generator, frequency: float, waves: int = 14) -> Singles:
        """Smooth noise of standard deviation 1, with features of about 3 / frequency [rad]."""
        height = self.directions.shape[1]
        factor, border = (4 if frequency < 40.0 else 2, 2) if height % 4 == 0 and height >= 256 else (1, 0)
        coarse = texture_directions(height // factor, border)
        total = np.zeros(coarse.shape[1:], np.float32)
        for _ in range(waves):
            wave = normalized(random.normal(size=3)) * frequency * random.uniform(0.3, 1.3)
            total += np.sin(np.tensordot(wave.astype(np.float32), coarse, 1) + np.float32(random.uniform(0, 6.28)))
        total *= np.float32(math.sqrt(2.0 / waves))
        if factor == 1:
            return total
        fine = cv2.resize(total, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        return np.asarray(fine[border * factor : -border * factor, border * factor : -border * factor])

    def stamp(self, centers: Floats, reaches: Number, shape: Shape) -> Singles:
        """Mask with a shape at each of the centers (n, 3). reaches: radius of the shapes [rad], one for all or (n,)."""
        mask = self.empty()
        for i, (center, reach) in enumerate(zip(centers, np.broadcast_to(reaches, len(centers)), strict=True)):
            polar = math.acos(np.clip(center[2], -1.0, 1.0))
            rows = slice(max(0, int((polar - reach) / self.texel) - 1), int((polar + reach) / self.texel) + 2)
            part = PaintingSphere(self.directions[:, rows])
            cosine = np.tensordot(center.astype(np.float32), part.directions, 1)
            near = np.nonzero(cosine > math.cos(reach))
            x_axis = normalized(np.roll(center, 1) - center * (np.roll(center, 1) @ center) + 1e-9)
            points = part.directions[:, near[0], near[1]]
            stretch = np.arccos(np.minimum(cosine[near], 1.0)) / np.sqrt(np.maximum(1.0 - cosine[near] ** 2, 1e-12))
            x, y = np.stack([x_axis, np.cross(center, x_axis)]).astype(np.float32) @ points * stretch
            mask[rows][near] = np.maximum(mask[rows][near], shape(x, y, i))
        return mask

    def panels(self, centers: Floats, groups: list[int]) -> tuple[Singles, Singles, Singles]:
        """Depths [rad] inside the panels of group 1, of group 2, and inside any panel.

        centers: of the panels (n, 3). groups: the group of each, 0 to 2.
        """
        strongest = [np.full(self.directions.shape[1:], -2.0, np.float32) for _ in range(4)]
        second = strongest[3].copy()
        for center, group in zip(centers, groups, strict=True):
            cosine = self.cosine_to(center)
            np.maximum(second, np.minimum(strongest[3], cosine), out=second)
            for which in (group, 3):
                np.maximum(strongest[which], cosine, out=strongest[which])
        apart = np.linalg.norm(centers[:, None] - centers, axis=2) + 9.0 * np.eye(len(centers))
        base, ink, accent, best = (each / np.float32(np.median(apart.min(axis=1))) for each in strongest)
        inside = best - second / np.float32(np.median(apart.min(axis=1)))
        return ink - np.maximum(base, accent), accent - np.maximum(base, ink), inside


@lru_cache(maxsize=6)
def texture_directions(height: int, border: int = 0) -> Singles:
    """Unit directions (3, height, 2 height) of an equirectangular texture, with `border` more pixels on all sides."""
    polar = (np.arange(-border, height + border) + 0.5)[:, None] * math.pi / height
    around = (np.arange(-border, 2 * height + border) + 0.5)[None] * math.pi / height
    across = np.sin(polar)
    z = np.broadcast_to(np.cos(polar), (across.shape[0], around.shape[1]))
    return frozen(np.stack([across * np.cos(around), across * np.sin(around), z]).astype(np.float32))


def normalized(vectors: Floats) -> Floats:
    """Vectors (..., n) scaled to length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@lru_cache(maxsize=64)
def spread_directions(count: int) -> Floats:
    """Evenly spread unit vectors (count, 3): the faces of a regular solid if there is one, otherwise a spiral.

    Of a solid the second half is opposite to the first.
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
        half = np.concatenate([normalized(part) for part in solids[count]])
        return frozen(np.concatenate([half, -half]))
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    return frozen(np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1))
