"""Poses of a board relative to the camera, from the rays through its corners."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError


def first_pose(places: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and translation (3,) [m] from the board to the camera frame, without iteration.

    places: (n, 2) on the board [m]. rays: (n, 3) unit vectors. A direct linear transform of rays instead of pixels, so
    that it holds for every lens, also beyond 90 degrees. Raises InputError if the corners determine no pose.
    """
    middle, spread = places.mean(axis=0), float(np.abs(places - places.mean(axis=0)).max())
    flat = np.column_stack([(places - middle) / spread, np.ones(len(places))])
    x, y, z = rays.T[:, :, None]
    nothing = np.zeros_like(flat)
    rows = [[nothing, -z * flat, y * flat], [z * flat, nothing, -x * flat], [-y * flat, x * flat, nothing]]
    equations = np.vstack([np.hstack(row) for row in rows])
    if not np.isfinite(equations).all():
        raise InputError("a corner lies where the lens sees nothing")
    homography = np.linalg.svd(equations, full_matrices=False)[2][-1].reshape(3, 3)
    if ((flat @ homography.T) * rays).sum() < 0.0:
        homography = -homography
    length = (np.linalg.norm(homography[:, 0]) + np.linalg.norm(homography[:, 1])) / 2.0
    if length < 1e-12:
        raise InputError("the corners lie in one line")
    right, up, center = (homography / length).T
    left_vectors, _, right_vectors = np.linalg.svd(np.column_stack([right, up, np.cross(right, up)]))
    rotation = left_vectors @ right_vectors
    return rotation, center * spread - rotation[:, :2] @ middle


def moved(rotations: Floats, translations: Floats, changes: Floats) -> tuple[Floats, Floats]:
    """Poses (g, 3, 3) and (g, 3) [m] after changes (g, 6): a turn [rad] as a vector, and a shift by its share of the
    distance of the board.
    """
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_rotvec(changes[:, :3]).as_matrix() @ rotations
    distance = np.linalg.norm(translations, axis=1, keepdims=True)
    return turned, translations + changes[:, 3:] * distance
