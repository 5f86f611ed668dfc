"""All that geometry says about a frame before its pixels are read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Mask
from ..geometry.lens import Lens, Size
from ..geometry.shape import Shape
from ..mesh.mesh import Mesh
from ..network.layout import Layout
from .footprint import Levels
from .projection import to_camera


class PreparedView(NamedTuple):
    """The mesh points that can be on screen, the camera that sees them, and the object that is sought among them.

    mesh: the points. layout: how the network takes them. levels: which picture of the pyramid colors each point. shape:
    of the real object. rings: number of mesh rings that cross it. height: of the camera over the plane [m]. The mesh
    frame is the observation plane's without the camera's yaw: x is ahead of the camera, z up. Objects are sought
    in it. rotation (3, 3): camera to mesh frame. heading (3, 3): mesh frame to the observation plane's, a turn around
    the vertical; with a height tolerance of 0 the yaw is not removed, and heading is the identity. lens, size [px]: of
    the frame. A named tuple, because each frame makes one: a frozen dataclass takes four times as long.
    """

    mesh: Mesh
    layout: Layout
    levels: Levels
    shape: Shape
    rings: float
    height: float
    rotation: Floats
    heading: Floats
    lens: Lens
    size: Size

    @property
    def ring_spacing(self) -> float:
        """Distance between two rings, in the units of `Shape.offset`: the object's outline is at 1."""
        return 2.0 / self.rings

    def outline(self, center: Floats) -> Floats:
        """Pixels (m, 2) of the part of an object's outline that the lens sees, on screen or not.

        center (3,): of the object, relative to the camera in the mesh frame [m].
        """
        camera = to_camera(self.shape.outline(center, self.height), self.rotation)
        return self.lens.project(camera[self.lens.sees(camera)], self.size)

    def ray_pixels(self, rays: Floats) -> Floats:
        """Pixels (n, 2) of rays (n, 3) in the mesh frame; NaN where the lens sees nothing."""
        return self._pixels(to_camera(rays, self.rotation))

    def plane_pixels(self, places: Floats) -> Floats:
        """Pixels (n, 2) of places (n, 2) [m] on the plane, from below the camera; NaN where the lens sees nothing."""
        x, y = places.T
        rays = np.array([x, y, np.full(len(places), -self.height)]) / np.sqrt(x * x + y * y + self.height**2)
        return self._pixels(((self.heading @ self.rotation).T @ rays).T)

    def _pixels(self, camera: Floats) -> Floats:
        """Pixels (n, 2) of rays (n, 3) in the camera frame; NaN where the lens sees nothing."""
        return np.where(self.lens.sees(camera)[:, None], self.lens.project(camera, self.size), np.nan)

    def in_picture(self, pixels: Floats) -> Mask:
        """Which pixels (n, 2) are inside the picture; NaN is not."""
        return np.asarray(((pixels >= 0.0) & (pixels <= np.array(self.size) - 1.0)).all(axis=1))

    def picture_pixels(self, places: Floats) -> Floats:
        """Pixels (n, 2) of places (n, 2) [m] on the plane; NaN outside of the picture."""
        pixels = self.plane_pixels(places)
        return np.where(self.in_picture(pixels)[:, None], pixels, np.nan)
