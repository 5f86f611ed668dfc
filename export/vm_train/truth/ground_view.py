"""Where a picture shows places on the observation plane and above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats, Mask
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation

from ..data.pictures import Picture


@dataclass(frozen=True, eq=False)
class GroundView:
    """A picture's camera. size [px]: of the picture."""

    lens: Lens
    orientation: Orientation
    size: Size

    @classmethod
    def of(cls, picture: Picture) -> GroundView:
        """The camera of a picture."""
        return cls(picture.fitted_lens, picture.orientation, picture.size)

    def pixels(self, places: Floats, height: float = 0.0) -> Floats:
        """Pixels (n, 2) of places (n, 2) [m] at a height [m]; NaN for those that the lens does not see."""
        toward = np.column_stack([places, np.full(len(places), height - self.orientation.height)])
        rays = toward @ self.orientation.rotation
        rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
        pixels = np.full((len(places), 2), np.nan)
        seen = self.lens.sees(rays)
        pixels[seen] = self.lens.project(rays[seen], self.size)
        return pixels

    def shows(self, places: Floats) -> Mask:
        """Whether places (n, 2) [m] of the plane are inside the picture, hidden or not."""
        with np.errstate(invalid="ignore"):
            pixels = self.pixels(places)
            return np.asarray(((pixels >= 0.0) & (pixels <= np.array(self.size) - 1.0)).all(axis=1))
