"""Fits a lens to the corners of a board in several frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens, Size

from .board_poses import first_pose, moved
from .frames import BoardSighting
from .lens_kinds import LENS_KINDS, LensKind, with_fov_of_picture
from .shared_fit import SharedFit, fit_shared

FEWEST_FRAMES = 5
"""Fewest frames for a lens: fewer hardly tell the focal length from the distance of the board."""

_OUTLIER = 1.0
"""Residuals beyond this [px] count less than quadratically."""

_WORSE = 3.0
"""A frame with this multiple of the median reprojection error is left out, if its error is above _NOTABLE [px] too."""

_NOTABLE = 0.5


@dataclass(frozen=True, eq=False)
class LensFit:
    """A fitted lens.

    kind: its name in LENS_KINDS. lens: for pictures of its size. focal_lengths and center [px], each with standard
    deviations (..., 2 rows: value, deviation). frames: the sightings used. errors: RMS reprojection error of each of
    them [px]. outliers: sightings left out, with their errors [px].
    """

    kind: str
    lens: Lens
    focal_lengths: Floats
    center: Floats
    frames: tuple[BoardSighting, ...]
    errors: Floats
    outliers: tuple[tuple[BoardSighting, float], ...]

    @property
    def error(self) -> float:
        """RMS reprojection error of all corners [px]."""
        weights = np.array([len(each.corners.pixels) for each in self.frames])
        return float(np.sqrt((self.errors**2 * weights).sum() / weights.sum()))

    @property
    def typical_error(self) -> float:
        """Median of the frames' errors [px], outliers included, to compare kinds of lenses."""
        return float(np.median([*self.errors, *(error for _, error in self.outliers)]))


def fit_lens(kind: str, sightings: list[BoardSighting], size: Size) -> LensFit:
    """Fit a lens of a kind to sightings in pictures of a size [px]; frames that disagree with the others are left out.

    Raises InputError for too few frames and for corners that this kind of lens can't have.
    """
    if len(sightings) < FEWEST_FRAMES:
        raise InputError(
            f"a lens needs the board in at least {FEWEST_FRAMES} usable frames, better 20, but there are "
            f"{len(sightings)}; show it in more places, at several distances and tilts"
        )
    outliers: list[tuple[BoardSighting, float]] = []
    numbers = None
    while True:
        problem = _Problem(LENS_KINDS[kind], sightings, size)
        fit = problem.solve(numbers)
        errors = problem.errors(fit)
        worst = int(np.argmax(errors))
        wrong = errors[worst] > max(_WORSE * float(np.median(errors)), _NOTABLE)
        if not wrong or len(sightings) <= FEWEST_FRAMES:
            break
        # One at a time: a bad frame raises the errors of good ones.
        outliers.append((sightings[worst], float(errors[worst])))
        sightings = sightings[:worst] + sightings[worst + 1 :]
        numbers = fit.shared
    return _result(kind, fit, size, sightings, errors, outliers)


def _result(
    kind: str,
    fit: SharedFit,
    size: Size,
    frames: list[BoardSighting],
    errors: Floats,
    outliers: list[tuple[BoardSighting, float]],
) -> LensFit:
    known, deviations = LENS_KINDS[kind], fit.deviations()
    count = known.focal_count
    focal = known.focal_lengths(fit.shared, size)
    unit = float(np.hypot(*size)) / 2.0
    return LensFit(
        kind,
        with_fov_of_picture(known.lens(fit.shared, size), size),
        np.stack([focal, focal * deviations[:count]]),
        np.stack([known.center(fit.shared, size), unit * deviations[count : count + 2]]),
        tuple(frames),
        errors,
        tuple(outliers),
    )


class _Problem:
    """The reprojection of the corners of all sightings, as a function of the lens and of the boards' poses."""

    def __init__(self, kind: LensKind, sightings: list[BoardSighting], size: Size) -> None:
        self.kind, self.size, self.sightings = kind, size, sightings
        self.frame: Indices = np.repeat(
            np.arange(len(sightings), dtype=np.int32), [len(each.corners.pixels) for each in sightings]
        )
        self.places = np.vstack([each.corners.places for each in sightings])
        self.pixels = np.vstack([each.corners.pixels for each in sightings])

    def solve(self, numbers: Floats | None) -> SharedFit:
        """The best lens, from given numbers or from the best of several focal lengths."""
        if numbers is None:
            # A pose cannot tell a long focal length from a large distance, so the start tries all usual ones.
            lengths = np.geomspace(0.2, 4.0, 14) * max(self.size)
            starts = [self.kind.start(float(each), self.size) for each in lengths]
            numbers = min(starts, key=self._first_error)
        poses = self._first_poses(numbers)
        if poses is None:
            raise InputError("the corners do not fit to this kind of lens; try another --lens")
        self.poses = poses
        own = np.zeros((len(self.sightings), 6))
        return fit_shared(self._residuals, np.repeat(self.frame, 2), numbers, own, _OUTLIER)

    def errors(self, fit: SharedFit) -> Floats:
        """RMS reprojection error of each sighting [px] (g,)."""
        square = (fit.residuals.reshape(-1, 2) ** 2).sum(axis=1)
        return np.asarray(np.sqrt(np.bincount(self.frame, square) / np.bincount(self.frame)))

    def _first_poses(self, numbers: Floats) -> tuple[Floats, Floats] | None:
        """Poses (g, 3, 3) and (g, 3) for a lens; None if it can't see some corner."""
        lens = self.kind.lens(numbers, self.size)
        try:
            found = [
                first_pose(each.corners.places, lens.unproject(each.corners.pixels, self.size))
                for each in self.sightings
            ]
        except InputError:
            return None
        return np.stack([each[0] for each in found]), np.stack([each[1] for each in found])

    def _first_error(self, numbers: Floats) -> float:
        """Median reprojection error [px] of a lens with the first poses."""
        poses = self._first_poses(numbers)
        if poses is None:
            return np.inf
        errors = np.linalg.norm(self._reprojected(numbers, *poses) - self.pixels, axis=1)
        return float(np.median(np.nan_to_num(errors, nan=1e6)))

    def _residuals(self, numbers: Floats, own: Floats) -> Floats:
        return np.asarray((self._reprojected(numbers, *moved(*self.poses, own)) - self.pixels).ravel())

    def _reprojected(self, numbers: Floats, rotations: Floats, translations: Floats) -> Floats:
        """Pixels (N, 2) of all corners."""
        corners = np.einsum("nij,nj->ni", rotations[self.frame][:, :, :2], self.places) + translations[self.frame]
        rays = corners / np.linalg.norm(corners, axis=1, keepdims=True)
        return self.kind.lens(numbers, self.size).project(rays, self.size)
