"""The objects in front of the ground: which pixels they reach, how much of each they cover, and the light they reflect.

A few rays per pixel find the objects. Then more rays shade them: few inside of an object, more at edges, and most for
a small ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles

from ..bodies.solids import LABELS
from ..scene.configuration import CLASSES
from ..scene.scene import PlacedBall, Scene
from .denoise import denoise
from .rays import pixel_angle, rays_through
from .tracer import BALL, NOTHING, OTHER, Tracer

_PROBES = ((0.0, 0.0), (-0.25, -0.25), (0.25, 0.25))  # [px], offsets of the rays that find objects
_INSIDE, _EDGE, _BALL = 2, 4, 8  # rays that shade a pixel, per row and column
_SMALL = 2500  # [px], area below which a ball is shaded with most rays
_TILES = 40  # tiles in a row of the picture, in which objects are sought
_GROUP = 32  # successive triangles that share a bounding sphere


@dataclass(frozen=True)
class Foreground:
    """The objects as a layer over the background.

    light: mean light (h, w, 3) of the covered part of each pixel. share: share (h, w) of each pixel that objects cover.
    coverage: share (h, w) that the ball or the objects to detect cover. classes: share (h, w, C) that objects of each
    class cover. areas: visible area of each of the scene's objects [px^2].
    """

    light: Singles
    share: Singles
    coverage: Singles
    classes: Singles
    areas: tuple[float, ...]

    def classes_over(self, background: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """The class (h, w) that covers most of each pixel, in front of the background's classes (h, w)."""
        classes = background.copy()
        rows, columns = np.nonzero(self.share)
        shares, behind = self.classes[rows, columns], background[rows, columns]
        shares[np.arange(len(rows)), behind] += 1.0 - self.share[rows, columns]
        classes[rows, columns] = shares.argmax(axis=-1)
        return classes


def trace_foreground(scene: Scene, tracer: Tracer, rays: Floats, brightest: float) -> Foreground:
    """Trace the objects of the scene that the tracer has loaded.

    rays: unit rays (h, w, 3) of the pixel centers in the world frame. brightest: limit for the light of a single path,
    which removes bright specks that no camera shows.
    """
    shape = rays.shape[:2]
    buffers = _Buffers(shape, len(scene.objects))
    reached, inside = _find_objects(scene, tracer, rays)
    small = np.zeros(shape, dtype=bool)
    for ball in (scene.ball, scene.other):
        if ball is not None:
            depth = _depth_in_outline(scene, rays, ball)
            reached |= depth > -2.0
            inside &= np.abs(depth) > 2.0
            if (depth > 0.0).sum() < _SMALL:
                small |= depth > -2.0
    seen = np.isfinite(rays[..., 0])
    reached = cv2.dilate(reached.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & seen
    for chosen, side in (
        (reached & inside & ~small, _INSIDE),
        (reached & ~inside & ~small, _EDGE),
        (small & seen, _BALL),
    ):
        if chosen.any():
            buffers.trace(scene, tracer, chosen, side, brightest)
    buffers.smooth(~small)
    return Foreground(buffers.light, buffers.share, buffers.coverage, buffers.classes, tuple(buffers.areas.tolist()))


def _find_objects(scene: Scene, tracer: Tracer, rays: Floats) -> tuple[Mask, Mask]:
    """Pixels (h, w) where a ray hits an object, and those of them that are not at an edge."""
    near = np.nonzero(_near_objects(scene, rays))  # (rows, columns)
    pixels = np.stack(near[::-1], axis=-1).astype(np.float64)
    count = np.zeros(rays.shape[:2], dtype=np.uint8)
    for offset in _PROBES:
        probes = rays_through(scene, pixels + offset) if any(offset) else rays[near]
        good = np.isfinite(probes[:, 0])
        count[near[0][good], near[1][good]] += (
            tracer.first_hits(scene.camera, probes[good].astype(np.float32)) != NOTHING
        )
    inside = cv2.erode((count == len(_PROBES)).astype(np.uint8), np.ones((3, 3), np.uint8))
    return count > 0, inside.astype(bool)


def _near_objects(scene: Scene, rays: Floats) -> Mask:
    """Pixels (h, w) in the tiles where rays (h, w, 3) may hit an object: most rays of a picture need no tracing.

    A tile and a group of triangles are seen within two cones; they can meet where the cones overlap.
    """
    height, width = rays.shape[:2]
    side = max(width // _TILES, 4)
    down, right = -height % side, -width % side
    tiles = np.pad(rays, ((0, down), (0, right), (0, 0)), mode="edge").astype(np.float32)
    rows, columns = (height + down) // side, (width + right) // side
    tiles = tiles.reshape(rows, side, columns, side, 3).swapaxes(1, 2).reshape(rows * columns, side**2, 3)
    middle = tiles[:, side * (side // 2) + side // 2]
    angle = 1.1 * np.arccos(np.clip((tiles @ middle[..., None]).min(axis=(1, 2)), -1.0, 1.0))
    angle += pixel_angle(scene.lens, scene.size)
    center, radius = _bounding_spheres(scene)
    toward = center - scene.camera
    distance = np.linalg.norm(toward, axis=1)
    sine = np.minimum(radius / distance, 1.0)
    cosine = np.sqrt(1.0 - sine**2)
    # cos(angle between the axes) - cos(sum of the cones' angles), as one product of matrices
    cones = np.column_stack([middle, -np.cos(angle), np.sin(angle)])
    others = np.column_stack([toward / distance[:, None], cosine, sine])
    meets = (cones.astype(np.float32) @ others.T.astype(np.float32)).max(axis=1, initial=-1.0) > -1e-5
    # Tiles that are very wide, or partly outside of the lens's field of view, are traced always.
    near = (meets | ~(angle < 1.5) | bool((distance <= radius).any())).reshape(rows, columns)
    near = np.repeat(np.repeat(near, side, axis=0), side, axis=1)
    return np.asarray(near[:height, :width])


def _bounding_spheres(scene: Scene) -> tuple[Floats, Floats]:
    """Centers (n, 3) and radii (n,) [m] of spheres that contain all objects.

    Groups that are wide as the camera sees them, as those with triangles of two bodies, get a sphere per triangle, and
    wide triangles get one for each of their quarters.
    """
    balls = [ball for ball in (scene.ball, scene.other) if ball is not None]
    centers, radii = [ball.center[None] for ball in balls], [np.array([1.001 * ball.radius]) for ball in balls]
    triangles = scene.mesh.triangles
    if len(triangles):
        triangles = np.pad(triangles, ((0, -len(triangles) % _GROUP), (0, 0)), mode="edge")
        corners = scene.mesh.vertices[triangles].reshape(-1, 3 * _GROUP, 3)
        for split in range(4):
            center, radius = _spheres_around(corners)
            wide = (radius > 0.2 * np.linalg.norm(center - scene.camera, axis=1)) & (split < 3)
            centers.append(center[~wide])
            radii.append(radius[~wide])
            corners = corners[wide].reshape(-1, 3, 3)
            if split:
                between = (corners + np.roll(corners, -1, axis=1)) / 2.0
                tips = np.stack([corners, between, np.roll(between, 1, axis=1)], axis=2)
                corners = np.concatenate([tips.reshape(-1, 3, 3), between])
    return np.concatenate([np.zeros((0, 3)), *centers]), np.concatenate([np.zeros(0), *radii])


def _spheres_around(points: Singles) -> tuple[Floats, Floats]:
    """Centers (n, 3) and radii (n,) of spheres that contain n groups of points (n, k, 3)."""
    low, high = points.min(axis=1).astype(np.float64), points.max(axis=1).astype(np.float64)
    return (low + high) / 2.0, 0.5001 * np.linalg.norm(high - low, axis=1)


def _depth_in_outline(scene: Scene, rays: Floats, ball: PlacedBall) -> Floats:
    """Distance (h, w) of the pixels from the outline of a ball [px], positive inside, and -1e9 far outside."""
    toward = ball.center - scene.camera
    distance = float(np.linalg.norm(toward))
    limit, pixel = np.arcsin(min(ball.radius / distance, 1.0)), pixel_angle(scene.lens, scene.size)
    cosine = rays @ (toward / distance)
    depth = np.full(rays.shape[:2], -1e9)
    close = cosine > np.cos(min(limit + 4.0 * pixel, np.pi))
    depth[close] = (limit - np.arccos(np.clip(cosine[close], -1.0, 1.0))) / pixel
    return depth


def _subpixel_offsets(side: int) -> Floats:
    """Offsets (side^2, 2) of a regular grid of rays within a pixel [px]."""
    steps = (np.arange(side) + 0.5) / side - 0.5
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


class _Buffers:
    """The arrays of a Foreground while it is traced, and the mean albedo, normal and distance of each pixel."""

    def __init__(self, shape: tuple[int, ...], objects: int) -> None:
        self.light, self.albedo, self.normal = (np.zeros((*shape, 3), dtype=np.float32) for _ in range(3))
        self.share, self.coverage = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
        self.depth = np.ones(shape, dtype=np.float32)
        self.classes = np.zeros((*shape, len(CLASSES)), dtype=np.float32)
        self.areas = np.zeros(objects)

    def trace(self, scene: Scene, tracer: Tracer, chosen: Mask, side: int, brightest: float) -> None:
        """Trace the chosen pixels (h, w) with side^2 rays each, and store the result."""
        rows, columns = np.nonzero(chosen)
        offsets = _subpixel_offsets(side)
        pixels = np.stack([columns, rows], axis=-1)[:, None].astype(np.float64) + offsets
        rays = rays_through(scene, pixels).reshape(-1, 3)
        rays[~np.isfinite(rays[:, 0])] = (0.0, 0.0, 1.0)
        single = rays.astype(np.float32)
        surfaces = tracer.first_surfaces(scene.camera, single)
        what = surfaces.what
        light = tracer.trace_light(scene.camera, single, what != NOTHING, len(offsets), scene.seed + side)
        np.minimum(light, brightest, out=light)
        covered = (what != NOTHING).reshape(len(rows), -1, 1)
        hit = covered[..., 0]
        depth = np.where(hit, surfaces.depth.reshape(hit.shape), np.float32(0.0)).sum(axis=1)
        here = rows, columns
        self.light[here] = _mean(light, covered)
        self.albedo[here] = _mean(surfaces.albedo, covered)
        self.normal[here] = _mean(surfaces.normal, covered)
        self.depth[here] = np.maximum(depth / np.maximum(hit.sum(axis=1), 1), 1e-3)
        self.share[here] = covered.mean(axis=(1, 2), dtype=np.float32)
        what = what.reshape(len(rows), -1)
        owner = _objects_hit(scene, what)
        self.coverage[here] = ((what == BALL) | (owner >= 0)).mean(axis=1, dtype=np.float32)
        self.areas += np.bincount(owner[owner >= 0], minlength=len(self.areas)) / len(offsets)
        for label, rays_of in _by_class(scene, what):
            self.classes[rows, columns, label] += rays_of.mean(axis=1, dtype=np.float32)

    def smooth(self, chosen: Mask) -> None:
        """Denoise the light of the chosen pixels (h, w)."""
        share = self.share * chosen
        rows, columns = np.flatnonzero(share.any(axis=1)), np.flatnonzero(share.any(axis=0))
        if len(rows):
            box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            self.light[box] = denoise(self.light[box], self.albedo[box], self.normal[box], self.depth[box], share[box])


def _mean(values: Singles, covered: Mask) -> Singles:
    """Mean (n, c) of values (n k, c) over those of the k rays of each pixel that hit an object, covered (n, k, 1)."""
    values = values.reshape(*covered.shape[:2], -1)
    total = np.zeros((len(values), values.shape[2]), dtype=np.float32)
    for ray in range(values.shape[1]):  # NumPy is slow with sums over a short axis in the middle
        total += np.where(covered[:, ray], values[:, ray], np.float32(0.0))
    return np.asarray(total / np.maximum(covered.sum(axis=1), 1), dtype=np.float32)


def _objects_hit(scene: Scene, what: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """Number of the scene's object that each ray (n, k) hits, -1 for all else; what: hits (n, k)."""
    own = len(scene.objects)
    if not own:
        return np.full(what.shape, -1)
    ends = np.cumsum(scene.counts[:own])
    body = np.searchsorted(ends, scene.mesh.triangles[np.maximum(what, 0), 0], side="right")
    return np.where((what >= 0) & (body < own), body, -1)


def _by_class(scene: Scene, what: npt.NDArray[np.int32]) -> list[tuple[int, Mask]]:
    """The position in CLASSES of each kind of object, and which rays (n, k) hit it; what: hits (n, k)."""
    labels = np.full(what.shape, -1, dtype=np.int32)
    mesh = what >= 0
    labels[mesh] = scene.mesh.labels[what[mesh]]
    found = [(CLASSES.index(name), labels == number) for number, name in enumerate(LABELS)]
    return [*found, (CLASSES.index("ball"), what == BALL), (CLASSES.index(scene.other_label), what == OTHER)]
