"""Patches: the picture around places where an object may be, in which an object has the same size at every distance.

A patch is a square in the plane that touches the unit sphere around the camera in the direction of the object. One
axis is level and points right; the other one points down. The side of the square is a fixed multiple of the radius
that the object is expected to have in the picture. So a ball at one meter gets as many samples as a ball at ten: the
paper's constant sample density, one level deeper.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from ..arrays import Floats, Image, Number, Singles
from ..network.look_contract import LookContract
from .prepared_view import PreparedView
from .pyramid import Pyramid

_NODES = 4
"""Number of rays along a side that the lens projects exactly. A cubic polynomial through their pixels gives the pixels
of all samples."""


@dataclass(frozen=True, eq=False)
class Tangents:
    """The planes of c patches, at the distance 1 from the camera.

    axes (c, 3): unit vectors to the centers of the patches. right, down (c, 3): unit vectors along their sides. radius
    (c,): half of the longest side of the object in the plane; of a ball the tangent of its angular radius.
    """

    axes: Floats
    right: Floats
    down: Floats
    radius: Floats

    @classmethod
    def at(cls, view: PreparedView, centers: Floats) -> Tangents:
        """The planes for objects of a view with centers (c, 3) [m], relative to the camera in the mesh frame."""
        return cls.around(centers, view.shape.half_size)

    @classmethod
    def around(cls, centers: Floats, size: Number) -> Tangents:
        """The same for objects whose longest sides are twice `size`: a number, or (c,) [m]."""
        distance = np.linalg.norm(centers, axis=1)
        axes = centers / distance[:, None]
        x, y, z = axes.T
        horizontal = np.hypot(x, y)
        # Straight below the camera no horizontal direction is ahead of another, so the mesh frame's x axis is taken.
        below = horizontal < 1e-9
        length = np.where(below, 1.0, horizontal)
        right, down = np.zeros_like(axes), np.empty_like(axes)
        right_x = right[:, 0] = y / length
        right_y = right[:, 1] = np.where(below, -1.0, -x / length)
        down[:, 0], down[:, 1], down[:, 2] = -z * right_y, z * right_x, x * right_y - y * right_x  # axes x right
        # The camera may be inside of the object, where no tangent exists.
        radius = size / np.sqrt(np.maximum(distance**2 - size**2, 1e-12))
        return cls(axes, right, down, radius)

    def turned(self, rotation: Floats) -> Tangents:
        """The same planes in another frame; rotation (3, 3) maps that frame to this one."""
        return Tangents(self.axes @ rotation, self.right @ rotation, self.down @ rotation, self.radius)

    def rays(self, right: Floats, down: Floats) -> Floats:
        """Unit vectors (..., c, 3) to places (..., c) in the planes, in radii to the right and down of the centers."""
        x, y = right * self.radius, down * self.radius
        rays = self.axes + x[..., None] * self.right + y[..., None] * self.down
        rays /= np.sqrt(1.0 + x * x + y * y)[..., None]
        return np.asarray(rays)


def patch_nodes(view: PreparedView, tangents: Tangents, extent: Number) -> Singles:
    """Pixels (2, c, N, N), x and y, of a grid over patches in these planes.

    extent: half the side of a patch, in expected radii; a number, or (c,). The grid goes from border to border, row by
    row from the upper left. A ray outside of the lens's view is moved to the edge of the view.
    """
    rays = tangents.turned(view.rotation).rays(*(each * extent for each in _node_places()))  # (N * N, c, 3)
    pixels = view.lens.project(_in_view(rays.reshape(-1, 3), view.lens.limit), view.size)
    return pixels.astype(np.float32).reshape(_NODES, _NODES, -1, 2).transpose(3, 2, 0, 1)


@cache
def _node_places() -> tuple[Floats, Floats]:
    """How far to the right and down (N * N, 1) the nodes of a patch are, in halves of its side."""
    steps = np.linspace(-1.0, 1.0, _NODES)
    down, right = np.meshgrid(steps, steps, indexing="ij")
    return right.reshape(-1, 1), down.reshape(-1, 1)


def samples(nodes: Singles, size: int) -> Singles:
    """Pixels (2, c, size, size) of patches' samples, from those of their nodes (2, c, N, N).

    A patch is divided into `size` rows of `size` equal squares. Each sample is in the middle of a square.
    """
    weights = _node_weights(nodes.shape[2], size)
    return np.asarray(np.matmul(weights, np.ascontiguousarray(nodes) @ weights.T))


@lru_cache(maxsize=32)
def _node_weights(count: int, size: int) -> Singles:
    """Share (size, count) of each of `count` nodes in each of `size` samples: Lagrange's polynomials."""
    at = (np.arange(size) + 0.5) / size * (count - 1)
    shares = [
        np.prod([(at - other) / (node - other) for other in range(count) if other != node], axis=0)
        for node in range(count)
    ]
    return np.stack(shares, axis=1).astype(np.float32)


def cut_patches(pyramid: Pyramid, nodes: Singles, size: int) -> Image:
    """Colors (c, size, size, 3), RGB, of patches with these nodes (2, c, N, N) [px] in the whole frame.

    Each patch is read from the sharpest level of the pyramid with less than two pixels between samples, but from the
    frame itself instead of the frame halved once: to halve all that patches need takes too long. Outside of the frame a
    patch repeats the frame's border.
    """
    levels = np.floor(np.log2(np.maximum(_spacing(nodes, size), 1.0))).astype(np.intp)
    levels[levels == 1] = 0
    shrunk = (nodes + np.float32(0.5)) * np.exp2(-levels, dtype=np.float32)[:, None, None] - np.float32(0.5)
    x, y = samples(shrunk, size)
    patches = np.empty((len(levels), size, size, 3), dtype=np.uint8)
    for level in np.flatnonzero(np.bincount(levels)).tolist():
        rows = np.flatnonzero(levels == level)
        colors = pyramid.at(level, x[rows].reshape(-1, size), y[rows].reshape(-1, size))
        patches[rows] = _rgb(colors, pyramid.channels).reshape(-1, size, size, 3)
    return patches


class Cut(NamedTuple):
    """Patches (k, size, size, 3), RGB, and their planes."""

    patches: Image
    tangents: Tangents


def cut_places(pyramid: Pyramid, view: PreparedView, centers: Floats, halves: Floats, contract: LookContract) -> Cut:
    """The patches around places, as a look network takes them.

    view: of the camera. centers: (k, 3) relative to the camera in the mesh frame [m]. halves (k,): of the longest sides
    of the objects there [m].
    """
    tangents = Tangents.around(centers, halves)
    nodes = patch_nodes(view, tangents, contract.extent)
    return Cut(cut_patches(pyramid, nodes, contract.size), tangents)


def _rgb(colors: Image, channels: tuple[int, int, int]) -> Image:
    """Colors (n, size[, channels]) as RGB (n, size, 3), with red, green and blue in these channels."""
    if colors.ndim == 2:
        return np.asarray(cv2.cvtColor(colors, cv2.COLOR_GRAY2RGB))
    if colors.shape[2] == 4:
        code = cv2.COLOR_RGBA2RGB if channels[0] == 0 else cv2.COLOR_BGRA2RGB
        return np.asarray(cv2.cvtColor(colors, code))
    return colors if channels[0] == 0 else np.asarray(cv2.cvtColor(colors, cv2.COLOR_BGR2RGB))


def _spacing(nodes: Singles, size: int) -> Singles:
    """Pixels (c,) between two samples in the middle of each patch."""
    middle, step = nodes.shape[2] // 2, (nodes.shape[2] - 1) / size
    right = nodes[:, :, middle, middle] - nodes[:, :, middle, middle - 1]
    down = nodes[:, :, middle, middle] - nodes[:, :, middle - 1, middle]
    return np.asarray(step * np.sqrt(np.abs(right[0] * down[1] - right[1] * down[0])))


def _in_view(camera: Floats, limit: float) -> Floats:
    """Unit rays (n, 3) in the camera frame; those more than `limit` [rad] from the axis are moved there, in place."""
    beyond = np.flatnonzero(camera[:, 0] < np.cos(limit))
    if len(beyond):
        sine = np.maximum(np.hypot(camera[beyond, 1], camera[beyond, 2]), 1e-12)
        camera[beyond, 0] = np.cos(limit)
        camera[beyond, 1:] *= (np.sin(limit) / sine)[:, None]
    return camera
