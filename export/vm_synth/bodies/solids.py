"""Triangle meshes with a color and a roughness per vertex, and the bodies of a scene, which consist of them.

Frame: z up [m], the observation plane is z = 0. Rotations are 3 x 3 matrices for column vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from vm_embedded.arrays import Floats, Indices, Mask, Singles

from .paints import Paint

if TYPE_CHECKING:
    from typing_extensions import Self  # typing has it from Python 3.11 on

LABELS = ("goal", "environment", "robot", "ball")
"""The classes of bodies; ball is that of the object to detect, also if it is not a ball."""

Point = Sequence[float] | Floats
"""Three coordinates [m]."""


@dataclass(frozen=True)
class Solid:
    """A mesh: vertices (n, 3) [m], unit normals (n, 3), triangles (m, 3), linear albedo (n, 3), roughness (n,)."""

    vertices: Singles
    normals: Singles
    triangles: Indices
    colors: Singles
    roughness: Singles

    @property
    def low(self) -> Floats:
        """Smallest coordinates (3,) [m]."""
        return np.asarray(self.vertices.min(axis=0), dtype=np.float64)

    @property
    def high(self) -> Floats:
        """Largest coordinates (3,) [m]."""
        return np.asarray(self.vertices.max(axis=0), dtype=np.float64)

    def shifted(self, by: Point) -> Self:
        """The solid moved by (3,) [m]."""
        return replace(self, vertices=self.vertices + np.asarray(by, dtype=np.float32))

    def turned(self, rotation: Floats) -> Self:
        """The solid rotated about the origin by a rotation (3, 3)."""
        turn = rotation.T.astype(np.float32)
        return replace(self, vertices=self.vertices @ turn, normals=_unit(self.normals @ turn))

    def stretched(self, x: float, y: float, z: float) -> Self:
        """The solid scaled along the axes by positive factors."""
        factors = np.array([x, y, z], dtype=np.float32)
        return replace(self, vertices=self.vertices * factors, normals=_unit(self.normals / factors))

    def painted(self, paint: Paint, where: Mask | None = None) -> Self:
        """The solid with a paint on all vertices, or on those of a mask (n,)."""
        chosen = slice(None) if where is None else where
        colors, roughness = self.colors.copy(), self.roughness.copy()
        colors[chosen], roughness[chosen] = paint.color, paint.roughness
        return replace(self, colors=colors, roughness=roughness)

    def stained(self, random: np.random.Generator, depth: float, scale: float) -> Self:
        """The solid with smooth stains. depth: largest loss of brightness, 0 to 1. scale: size of the stains [m]."""
        shade = 1.0 - depth * (0.5 + 0.5 * waves(random, self.vertices, scale))
        return replace(self, colors=np.clip(self.colors * shade[:, None], 0.0, 1.0).astype(np.float32))


@dataclass(frozen=True)
class Body(Solid):
    """A solid in the scene with its class, one of LABELS, and its name."""

    label: str
    name: str

    def moved(self, rotation_about_z: float, position: Point) -> Self:
        """The body rotated about the vertical axis by an angle [rad], then moved by a position (3,) [m]."""
        return self.turned(rotation(yaw=rotation_about_z)).shifted(position)


DrawBody = Callable[[np.random.Generator, float], list[Body]]
"""Draws a body: a function of (random, size [m])."""


@dataclass(frozen=True)
class JoinedBodies(Solid):
    """Many bodies as one mesh. labels: position in LABELS of each triangle (m,)."""

    labels: Indices


def join_bodies(bodies: Sequence[Body]) -> JoinedBodies:
    """Bodies as one mesh. Without bodies the mesh is empty."""
    whole = merged(bodies)
    labels = [np.full(len(body.triangles), LABELS.index(body.label), dtype=np.int32) for body in bodies]
    return JoinedBodies(**vars(whole), labels=np.concatenate([np.zeros(0, dtype=np.int32), *labels]))


def merged(solids: Iterable[Solid]) -> Solid:
    """Several solids as one."""
    parts = [_EMPTY, *solids]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Solid(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.triangles + np.int32(start) for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.colors for part in parts]),
        np.concatenate([part.roughness for part in parts]),
    )


def body(solids: Iterable[Solid], label: str, name: str) -> Body:
    """A body from solids in their final positions."""
    return Body(**vars(merged(solids)), label=label, name=name)


def standing(solids: Iterable[Solid], label: str, name: str) -> Body:
    """A body from solids, moved vertically to stand on the plane."""
    whole = body(solids, label, name)
    return whole.shifted((0.0, 0.0, -whole.low[2]))


def sized(whole: Body, size: float) -> Body:
    """The body scaled to a longest side of `size` [m], on the plane around the origin."""
    factor = size / float((whole.high - whole.low).max())
    middle = (whole.low + whole.high) / 2.0
    return whole.shifted((-middle[0], -middle[1], -whole.low[2])).stretched(factor, factor, factor)


def rotation(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Floats:
    """Rotation (3, 3) by angles [rad] about x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def along(start: Point, end: Point) -> Floats:
    """Rotation (3, 3) that maps z to the direction from start to end, and x as close to forward as possible."""
    return np.asarray(along_each(np.subtract(end, start)[None])[0])


def along_each(steps: Floats) -> Floats:
    """Rotations (n, 3, 3) that map z to the directions of steps (n, 3), and x as close to forward as possible."""
    up = _directions(steps)
    steep = (np.abs(up[:, :1]) >= 0.9).astype(np.float64)
    side = _directions(_cross(up, np.concatenate([1.0 - steep, np.zeros_like(steep), -steep], axis=1)))
    return np.stack([_cross(side, up), side, up], axis=2)


def between(solid: Solid, start: Point, end: Point) -> Solid:
    """A solid around the origin, moved midway between two points with its z axis along them."""
    return solid.turned(along(start, end)).shifted(np.add(start, end) / 2.0)


def distance(start: Point, end: Point) -> float:
    """Distance between two points [m]."""
    return float(np.linalg.norm(np.subtract(end, start)))


def waves(random: np.random.Generator, points: Singles, scale: float) -> Singles:
    """Smooth noise (n,) from -1 to 1 at points (n, 3) [m], with features of the size `scale` [m]."""
    directions = random.normal(size=(5, 3)) * (2.5 / scale)
    phases = random.uniform(0.0, 2.0 * np.pi, 5)
    return np.asarray(np.sin(points @ directions.T + phases).mean(axis=1) * 1.5).clip(-1.0, 1.0).astype(np.float32)


def _directions(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _cross(first: Floats, second: Floats) -> Floats:
    """Cross products (n, 3) of vectors (n, 3), faster than those of NumPy if n is small."""
    (a, b, c), (x, y, z) = first.T, second.T
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)


def _unit(vectors: Singles) -> Singles:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True), dtype=np.float32)


_EMPTY = Solid(
    np.zeros((0, 3), dtype=np.float32),
    np.zeros((0, 3), dtype=np.float32),
    np.zeros((0, 3), dtype=np.int32),
    np.zeros((0, 3), dtype=np.float32),
    np.zeros(0, dtype=np.float32),
)
