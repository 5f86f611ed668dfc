"""The exact outlines of objects in a picture."""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shape import Shape

_CORNERS = 256


def sphere_outline(
    lens: Lens, orientation: Orientation, center: Floats, radius: float, size: Size, unseen: bool = False
) -> Floats:
    """Project the rays that touch a sphere: the outline as a polygon, pixels (256, 2).

    center (3,) and radius [m] of the sphere; the world's origin is on the plane below the camera. size: width and
    height of the picture [px]. Corners outside of the lens's field of view are NaN; with `unseen` they are projected
    too.
    """
    toward = (center - np.array([0.0, 0.0, orientation.height])) @ orientation.rotation
    return _project(touching_rays(toward[None], np.array([radius]), _CORNERS)[0], lens, size, unseen)


def touching_rays(toward: Floats, radii: Floats, corners: int) -> Floats:
    """Unit rays (m, corners, 3) that touch spheres at `toward` (m, 3) from the camera, with `radii` (m,), both [m]."""
    distance = np.linalg.norm(toward, axis=1, keepdims=True)
    axis = toward / distance
    side = np.cross(axis, np.where(np.abs(axis[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    turn = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)[:, None]
    around = np.cos(turn) * side[:, None] + np.sin(turn) * np.cross(axis, side)[:, None]
    sine = np.minimum(radii[:, None] / distance, 1.0)[:, None]  # of the angle between the axis and the rays
    return np.asarray(np.sqrt(1.0 - sine * sine) * axis[:, None] + sine * around)


def shape_outline(
    lens: Lens, orientation: Orientation, shape: Shape, center: Floats, size: Size, unseen: bool = False
) -> Floats:
    """The outline of an object on the plane as a polygon, pixels (256, 2).

    center (3,) [m]: of the object; the world's origin is on the plane below the camera. size, unseen: as in
    sphere_outline. Raises GeometryError for a camera inside of the object.
    """
    height = orientation.height
    rays = shape.outline(center - np.array([0.0, 0.0, height]), height, _CORNERS) @ orientation.rotation
    return _project(rays, lens, size, unseen)


def _project(rays: Floats, lens: Lens, size: Size, unseen: bool) -> Floats:
    pixels = lens.project(rays, size)
    if not unseen:
        pixels[~lens.sees(rays)] = np.nan
    return pixels


def polygon_area(pixels: Floats) -> float:
    """Area [px^2] of a polygon (n, 2); corners that are NaN are skipped."""
    x, y = pixels[np.isfinite(pixels).all(axis=1)].T
    return float(abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2.0)
