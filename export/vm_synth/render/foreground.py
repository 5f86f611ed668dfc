"""The things of a picture: which pixels they reach, how much of each they cover, and the light that they throw back.

A few rays a pixel tell where things are. Then many rays shade their edges, fewer their inside, most a small ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask, Singles
from vm_embedded.geometry.lens import Lens, Size

from ..bodies.solids import LABELS
from ..scene.configuration import CLASSES
from ..scene.scene import PlacedBall, Scene
from .denoise import smoothed
from .tracer import BALL, NOTHING, OTHER, Tracer

_LOOKS = ((0.0, 0.0), (-0.25, -0.25), (0.25, 0.25))  # where in a pixel rays look for things
_INSIDE, _EDGE, _BALL = 2, 4, 8  # rays a pixel and direction that shade
_SMALL = 2500  # [px], balls that are shaded with most rays


@dataclass(frozen=True)
class Things:
    """Things as a layer over the background (h, w): mean light (h, w, 3) of what they cover, the share of each pixel
    that they cover, the share that the ball covers, and for each class the share of the pixel (h, w, C)."""

    light: Singles
    share: Singles
    coverage: Singles
    classes: Singles

    def classes_before(self, background: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """The class (h, w) that covers most of each pixel, given that of the background."""
        shares = self.classes.copy()
        rows, columns = np.ogrid[: background.shape[0], : background.shape[1]]
        shares[rows, columns, background] += 1.0 - self.share
        return np.asarray(shares.argmax(axis=-1), dtype=np.uint8)


def pixel_grid(size: Size) -> Floats:
    """Centers (h, w, 2) of all pixels."""
    x, y = np.meshgrid(np.arange(size[0], dtype=np.float64), np.arange(size[1], dtype=np.float64))
    return np.stack([x, y], axis=-1)


def rays_through(scene: Scene, pixels: Floats) -> Floats:
    """Rays (..., 3) of the world through pixels (..., 2); NaN where the lens sees nothing."""
    rays = scene.lens.unproject(pixels.reshape(-1, 2), scene.size)
    rays[~scene.lens.sees(rays)] = np.nan
    return (rays @ scene.orientation.rotation.T).reshape(*pixels.shape[:-1], 3)


def pixel_angle(lens: Lens, size: Size) -> float:
    """Angle [rad] between two pixels in the middle of the picture."""
    middle = np.array([[size[0] / 2.0, size[1] / 2.0], [size[0] / 2.0 + 1.0, size[1] / 2.0]])
    first, second = lens.unproject(middle, size)
    return float(np.arccos(np.clip(first @ second, -1.0, 1.0)))


def trace_things(scene: Scene, tracer: Tracer, rays: Floats, brightest: float) -> Things:
    """Trace the things of the scene that the tracer holds, for pixels whose centers see along rays (h, w, 3).

    brightest: the light to which single paths are cut; a camera shows no such specks.
    """
    shape = rays.shape[:2]
    buffers = _Buffers(shape)
    reached, inside = _reached(scene, tracer, rays)
    small = np.zeros(shape, dtype=bool)
    for ball in (scene.ball, scene.other):
        if ball is not None:
            depth = _inside_outline(scene, rays, ball)
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
    return Things(buffers.light, buffers.share, buffers.coverage, buffers.classes)


def _reached(scene: Scene, tracer: Tracer, rays: Floats) -> tuple[Mask, Mask]:
    """Pixels (h, w) in which a ray meets a thing, and those of them that are not at an edge."""
    grid = pixel_grid(scene.size)
    count = np.zeros(rays.shape[:2], dtype=np.uint8)
    for offset in _LOOKS:
        looking = (rays_through(scene, grid + offset) if any(offset) else rays).reshape(-1, 3)
        good = np.flatnonzero(np.isfinite(looking[:, 0]))
        count.reshape(-1)[good] += tracer.meets(scene.camera, looking[good].astype(np.float32)) != NOTHING
    inside = cv2.erode((count == len(_LOOKS)).astype(np.uint8), np.ones((3, 3), np.uint8))
    return count > 0, inside.astype(bool)


def _inside_outline(scene: Scene, rays: Floats, ball: PlacedBall) -> Floats:
    """How far (h, w) rays pass inside the outline of a ball [px], negative outside."""
    toward = ball.center - scene.camera
    distance = float(np.linalg.norm(toward))
    limit = np.arcsin(min(ball.radius / distance, 1.0))
    angle = np.arccos(np.clip(rays @ (toward / distance), -1.0, 1.0))
    return np.asarray(np.nan_to_num((limit - angle) / pixel_angle(scene.lens, scene.size), nan=-1e9))


def _subpixels(side: int) -> Floats:
    """Offsets (side^2, 2) of rays in a pixel."""
    steps = (np.arange(side) + 0.5) / side - 0.5
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


class _Buffers:
    """What is known of each pixel: see Things; and mean albedo, normal and distance of what it shows."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.light, self.albedo, self.normal = (np.zeros((*shape, 3), dtype=np.float32) for _ in range(3))
        self.share, self.coverage = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
        self.depth = np.ones(shape, dtype=np.float32)
        self.classes = np.zeros((*shape, len(CLASSES)), dtype=np.float32)

    def trace(self, scene: Scene, tracer: Tracer, chosen: Mask, side: int, brightest: float) -> None:
        """Trace the chosen pixels (h, w) with side^2 rays each."""
        rows, columns = np.nonzero(chosen)
        offsets = _subpixels(side)
        pixels = np.stack([columns, rows], axis=-1)[:, None].astype(np.float64) + offsets
        rays = rays_through(scene, pixels).reshape(-1, 3)
        rays[~np.isfinite(rays[:, 0])] = (0.0, 0.0, 1.0)
        single = rays.astype(np.float32)
        light = tracer.radiance(scene.camera, single, len(offsets), scene.seed + side)
        np.minimum(light, brightest, out=light)
        what = tracer.meets(scene.camera, single)
        surfaces = tracer.surfaces(scene.camera, single)
        covered = (what != NOTHING).reshape(len(rows), -1, 1)
        depth = np.where(np.isfinite(surfaces.depth), surfaces.depth, 1.0)
        here = rows, columns
        self.light[here] = _mean(light, covered)
        self.albedo[here] = _mean(surfaces.albedo, covered)
        self.normal[here] = _mean(surfaces.normal, covered)
        self.depth[here] = np.maximum(_mean(depth, covered)[:, 0], 1e-3)
        self.share[here] = covered.mean(axis=(1, 2), dtype=np.float32)
        what = what.reshape(len(rows), -1)
        self.coverage[here] = (what == BALL).mean(axis=1, dtype=np.float32)
        for label, rays_of in _by_class(scene, what):
            self.classes[rows, columns, label] += rays_of.mean(axis=1, dtype=np.float32)

    def smooth(self, chosen: Mask) -> None:
        """Take the grain out of the light of the chosen pixels (h, w)."""
        share = self.share * chosen
        rows, columns = np.flatnonzero(share.any(axis=1)), np.flatnonzero(share.any(axis=0))
        if len(rows):
            box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
            self.light[box] = smoothed(self.light[box], self.albedo[box], self.normal[box], self.depth[box], share[box])


def _mean(values: Singles, covered: Mask) -> Singles:
    """Means (n, c) over the rays of each pixel that meet something, covered (n, k, 1), of values (n k, c)."""
    values = values.reshape(*covered.shape[:2], -1)
    total = np.where(covered, values, 0.0).sum(axis=1, dtype=np.float32)
    return np.asarray(total / np.maximum(covered.sum(axis=1), 1), dtype=np.float32)


def _by_class(scene: Scene, what: npt.NDArray[np.int32]) -> list[tuple[int, Mask]]:
    """For each thing that rays (n, k) meet, its class and which rays meet it."""
    labels = np.full(what.shape, -1, dtype=np.int32)
    mesh = what >= 0
    labels[mesh] = scene.mesh.labels[what[mesh]]
    found = [(CLASSES.index(name), labels == number) for number, name in enumerate(LABELS)]
    return [*found, (CLASSES.index("ball"), what == BALL), (CLASSES.index(scene.other_label), what == OTHER)]
