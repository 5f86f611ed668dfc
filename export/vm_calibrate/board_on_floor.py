"""Fits height, pitch and roll of a fixed camera to a board that lies on the floor."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens import Lens, Size

from .board_poses import first_pose
from .floor_pose import PoseFit, numbers_of, orientation_of, pose_fit
from .frames import Sighting
from .shared_fit import SharedFit, fit_shared

_OUTLIER = 1.0
"""Residuals beyond this [px] count less than quadratically."""

_WRONG = 3.0
"""A frame with this multiple of the median error, and above 1 px, is left out."""

_ADVICE = "put a larger board, or put it nearer, and film it in several places on the floor"


def fit_board_on_floor(sightings: list[Sighting], lens: Lens, size: Size, thickness: float) -> PoseFit:
    """The pose from one or more places of a board in pictures of a size [px].

    thickness: height of the printed side over the floor [m]. Raises InputError if the board is not on the floor below
    the camera.
    """
    sightings, left_out = list(sightings), dict[str, str]()
    while True:
        problem = _Problem(sightings, lens, size, thickness)
        fit = problem.solve()
        squares = (fit.residuals.reshape(-1, 2) ** 2).sum(axis=1)
        errors = np.sqrt(np.bincount(problem.frame, squares) / np.bincount(problem.frame))
        worst = int(np.argmax(errors))
        if len(sightings) < 3 or errors[worst] < max(_WRONG * float(np.median(errors)), 1.0):
            break
        left_out[sightings[worst].name] = f"{errors[worst]:.1f} px off; did the camera or the board move?"
        del sightings[worst]
    residuals = {each.name: float(error) for each, error in zip(sightings, errors, strict=True)}
    return pose_fit(fit, float(np.sqrt(squares.mean())), residuals, left_out, _ADVICE)


class _Problem:
    """The corners of boards on the floor, as a function of the camera's pose and of the boards' places."""

    def __init__(self, sightings: list[Sighting], lens: Lens, size: Size, thickness: float) -> None:
        self.sightings, self.lens, self.size, self.thickness = sightings, lens, size, thickness
        self.frame: Indices = np.repeat(
            np.arange(len(sightings), dtype=np.int32), [len(each.corners.pixels) for each in sightings]
        )
        self.places = np.vstack([each.corners.places for each in sightings])
        self.pixels = np.vstack([each.corners.pixels for each in sightings])

    def solve(self) -> SharedFit:
        """The best pose, from the mean of those that each board alone gives."""
        poses = [self._alone(each) for each in self.sightings]
        # Detectors count rows downwards, so that a board is mirrored if its first axis runs right and its third up.
        sides = np.array([-np.sign(shift @ rotation[:, 2]) for rotation, shift in poses])
        poses = [(rotation * (1.0, 1.0, side), shift) for (rotation, shift), side in zip(poses, sides, strict=True)]
        self.places = self.places * np.column_stack([np.ones(len(self.frame)), sides[self.frame]])
        normal = np.sum([rotation[:, 2] for rotation, _ in poses], axis=0)
        normal /= np.linalg.norm(normal)
        height = float(np.median([-shift @ normal for _, shift in poses])) + self.thickness
        if height <= 0.0:
            raise InputError(
                "the board is not on a floor below the camera; the camera must see its printed side from above"
            )
        shared = numbers_of(normal, height)
        own = np.stack([self._place(shared, rotation, shift) for rotation, shift in poses])
        return fit_shared(self._residuals, np.repeat(self.frame, 2), shared, own, _OUTLIER)

    def _alone(self, sighting: Sighting) -> tuple[Floats, Floats]:
        """Rotation and translation from a board to the camera."""
        try:
            return first_pose(sighting.corners.places, self.lens.unproject(sighting.corners.pixels, self.size))
        except InputError as error:
            raise InputError(f"{sighting.name}: {error}; does the lens file belong to this camera?") from error

    def _place(self, shared: Floats, rotation: Floats, shift: Floats) -> Floats:
        """Place on the floor, in camera heights, and heading of a board (3,) [rad], for a camera pose."""
        level = orientation_of(shared).rotation
        across, at = level @ rotation[:, 0], level @ shift / np.exp(shared[0])
        return np.array([at[0], at[1], np.arctan2(across[1], across[0])])

    def _residuals(self, shared: Floats, own: Floats) -> Floats:
        orientation = orientation_of(shared)
        own = own[self.frame]
        cosine, sine = np.cos(own[:, 2]), np.sin(own[:, 2])
        x, y = self.places.T
        corners = np.column_stack(
            [
                own[:, 0] * orientation.height + cosine * x - sine * y,
                own[:, 1] * orientation.height + sine * x + cosine * y,
                np.full(len(x), self.thickness - orientation.height),
            ]
        )
        rays = corners @ orientation.rotation
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        return np.asarray((self.lens.project(rays, self.size) - self.pixels).ravel())
