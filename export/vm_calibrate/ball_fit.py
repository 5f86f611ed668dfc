"""Fits height, pitch and roll of a fixed camera to the outlines or boxes of balls on the floor.

A ball's size gives its distance and its place gives its direction, so each ball is a point at the height of its radius
over the floor. Three points that are not in one line determine the plane.
"""

from __future__ import annotations

import math

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens, Size
from vm_workstation.outlines import touching_rays

from .balls import SeenBall
from .floor_pose import PoseFit, numbers_of, orientation_of, pose_fit
from .shared_fit import SharedFit, fit_shared

FEWEST_BALLS = 3

_CORNERS = 96
"""Corners of a ball's outline: its area is then too small by less than 0.1 %."""

_OUTLIER = 1.0
"""Residuals beyond this [px] count less than quadratically."""

_WRONG = 5.0
"""A ball whose residual is this multiple of the noise, and above 2 px, is left out."""

_AT_ONCE = 0.05
"""Largest share of the balls to leave out before the next fit: each fit of hundreds of balls takes seconds."""

_ASSUMED = (1.0, 2)
"""Noise of outlines and boxes [px] as it is expected, which counts as much as this number of residuals."""


def fit_balls(balls: list[SeenBall], lens: Lens, size: Size) -> PoseFit:
    """The pose from balls in pictures of a size [px], all by outlines or all by boxes.

    Raises InputError for too few usable balls.
    """
    left_out = {each.name: "cut off by the edge of the picture" for each in balls if each.cut_off(size)}
    usable = [each for each in balls if each.name not in left_out]
    for ball in usable:
        if not np.isfinite(lens.unproject(ball.middle[None], size)).all():
            left_out[ball.name] = "outside of the lens's field of view"
    usable = [each for each in usable if each.name not in left_out]
    while True:
        if len(usable) < FEWEST_BALLS:
            raise InputError(
                f"a pose needs at least {FEWEST_BALLS} whole balls on the floor, better 10, but there are {len(usable)}"
                + (f" ({len(left_out)} left out: {next(iter(left_out.values()))})" if left_out else "")
            )
        problem = _Problem(usable, lens, size)
        fit = problem.solve()
        errors = np.sqrt((fit.residuals.reshape(len(usable), -1) ** 2).mean(axis=1))
        limit = max(_WRONG * float(np.median(errors)), 2.0)
        most = min(max(int(_AT_ONCE * len(usable)), 1), len(usable) - FEWEST_BALLS)
        wrong = {usable[at].name: errors[at] for at in np.argsort(-errors)[:most] if errors[at] >= limit}
        if not wrong:
            break
        left_out |= {
            name: f"{error:.1f} px off; not on the floor, hidden, or another ball?" for name, error in wrong.items()
        }
        usable = [each for each in usable if each.name not in wrong]
    residuals = {each.name: float(error) for each, error in zip(usable, errors, strict=True)}
    error = float(np.sqrt((fit.residuals**2).mean()))
    return pose_fit(fit, error, residuals, left_out, problem.advice(fit))


class _Problem:
    """Outlines or boxes of balls, as a function of the camera's pose and of the balls' directions."""

    def __init__(self, balls: list[SeenBall], lens: Lens, size: Size) -> None:
        self.lens, self.size = lens, size
        self.boxes = balls[0].is_box
        self.radii = np.array([each.radius for each in balls])
        self.measured = np.stack([each.measured for each in balls])
        self.groups: Indices = np.repeat(np.arange(len(balls), dtype=np.int32), self.measured.shape[1])
        self.rays = lens.unproject(np.stack([each.middle for each in balls]), size)
        self.sides = np.stack([np.linalg.svd(ray[None])[2][1:] for ray in self.rays])
        self.unit = 1.0 / lens.scale
        """Angle of a pixel [rad], so that the balls' own numbers are in pixels."""
        self.sizes = np.stack([each.size for each in balls])

    def solve(self) -> SharedFit:
        """The best pose, from the two best starts: balls in one line have more than one minimum."""
        own = np.zeros((len(self.radii), 2))
        starts = sorted(self._starts(), key=lambda start: _cost(self._residuals(start, own)))[:2]
        fits = [fit_shared(self._residuals, self.groups, start, own, _OUTLIER, _ASSUMED) for start in starts]
        return min(fits, key=lambda fit: _cost(fit.residuals))

    def advice(self, fit: SharedFit) -> str:
        """What balls are missing for a well determined pose."""
        distances = np.linalg.norm(self._centers(fit.shared, self.rays), axis=1)
        near, far = distances.min(), distances.max()
        return f"the balls are {near:.1f} to {far:.1f} m away: add some nearer, farther, and to both sides"

    def _starts(self) -> list[Floats]:
        """Poses from which to start: the plane through the balls' centers, and level cameras of several pitches."""
        distances = self.radii / np.sin(np.minimum(self.sizes * self.unit, 1.5))
        centers = self.rays * distances[:, None]
        weights = distances**-2  # a pixel more or less changes the distance by its square
        middle = (weights[:, None] * centers).sum(axis=0) / weights.sum()
        normal = np.linalg.svd((centers - middle) * weights[:, None])[2][-1]
        normals = [normal if normal[2] >= 0.0 else -normal]
        normals += [np.array([-math.sin(pitch), 0.0, math.cos(pitch)]) for pitch in (0.0, 0.4, 0.8, 1.2)]
        heights = [float(np.median(self.radii - centers @ each)) for each in normals]
        return [numbers_of(each, max(height, 0.05)) for each, height in zip(normals, heights, strict=True)]

    def _centers(self, pose: Floats, rays: Floats) -> Floats:
        """Centers (m, 3) [m], in the camera frame, of balls on the floor in the directions of rays (m, 3)."""
        orientation = orientation_of(pose)
        down = -(rays @ orientation.rotation[2])
        away = (orientation.height - self.radii) / np.maximum(down, 1e-3)
        return np.asarray(rays * np.maximum(away, 1.001 * self.radii)[:, None])

    def _residuals(self, pose: Floats, own: Floats) -> Floats:
        rays = self.rays + np.einsum("mk,mki->mi", own * self.unit, self.sides)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        touching = touching_rays(self._centers(pose, rays), self.radii, _CORNERS)
        pixels = self.lens.project(touching.reshape(-1, 3), self.size).reshape(len(rays), _CORNERS, 2)
        seen = _boxes(pixels) if self.boxes else _circles(pixels)
        return np.asarray((seen - self.measured).ravel())


def _cost(residuals: Floats) -> float:
    """A sum that large residuals (N,) [px] enter linearly."""
    return float(np.nan_to_num(np.abs(residuals), nan=1e4).clip(max=1e4).sum())


def _boxes(polygons: Floats) -> Floats:
    """Left, top, right and bottom edges (m, 4) of polygons (m, k, 2) [px]."""
    return np.concatenate([polygons.min(axis=1), polygons.max(axis=1)], axis=1)


def _circles(polygons: Floats) -> Floats:
    """Centers and radii (m, 3) of the circles with the center and area of polygons (m, k, 2) [px]."""
    origin = polygons.mean(axis=1, keepdims=True)
    here = polygons - origin
    ahead = np.roll(here, -1, axis=1)
    cross = here[..., 0] * ahead[..., 1] - here[..., 1] * ahead[..., 0]
    area = cross.sum(axis=1) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):  # a pose far off may shrink a ball to nothing
        center = ((here + ahead) * cross[..., None]).sum(axis=1) / (6.0 * area[:, None]) + origin[:, 0]
    return np.column_stack([center, np.sqrt(np.abs(area) / np.pi)])
