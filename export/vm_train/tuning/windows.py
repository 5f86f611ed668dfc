"""Windows: square places in a picture without lens and pose, where the size of an object says nothing of its distance.

A patch of a window is cut as one of a place on the plane, but its sides are straight in the picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image, Mask
from vm_embedded.detection.patches import cut_patches
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.geometry.lens import Size
from vm_embedded.network.look_contract import LookContract

from ..look.labels import PlaceLabels, label_by_differences

_AT_ONCE = 200
"""Patches to cut at once; cv2.remap takes tables of less than 32,768 rows."""

_CORNERS = np.array([[-1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Windows:
    """n windows: centers (n, 2) as x and y [px], pixel centers at integers, and the radii (n,) [px] of the objects that
    are expected there."""

    centers: Floats
    radii: Floats

    def __len__(self) -> int:
        return len(self.radii)

    @classmethod
    def none(cls) -> Windows:
        """No windows."""
        return cls(np.empty((0, 2)), np.empty(0))

    @classmethod
    def joined(cls, *parts: Windows) -> Windows:
        """All windows of several parts, in order."""
        return cls(np.concatenate([each.centers for each in parts]), np.concatenate([each.radii for each in parts]))

    def part(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Windows:
        """The windows of a mask (n,), or with these numbers."""
        return Windows(self.centers[chosen], self.radii[chosen])

    def moved(self, right: Floats, down: Floats) -> Windows:
        """The windows after shifts (n,) in expected radii."""
        return Windows(self.centers + np.stack([right, down], axis=1) * self.radii[:, None], self.radii)

    def cut(self, pyramid: Pyramid, contract: LookContract) -> Image:
        """Patches (n, size, size, 3), RGB, of a frame, as a network needs them."""
        if not len(self):
            return np.empty((0, contract.size, contract.size, 3), dtype=np.uint8)
        reach = contract.extent * self.radii[:, None, None]
        x = self.centers[:, 0, None, None] + reach * _CORNERS
        y = self.centers[:, 1, None, None] + reach * _CORNERS.T
        nodes = np.stack([x, y]).astype(np.float32)
        starts = range(0, len(self), _AT_ONCE)
        return np.concatenate(
            [cut_patches(pyramid, nodes[:, start : start + _AT_ONCE], contract.size) for start in starts]
        )

    def label(self, objects: Windows) -> PlaceLabels:
        """What the windows show of true objects; the same rules as for places on the plane."""
        shift = (objects.centers - self.centers[:, None]) / self.radii[:, None, None]
        size = np.log(objects.radii / self.radii[:, None])
        right, down = shift[..., 0], shift[..., 1]
        return label_by_differences(right, down, np.hypot(right, down), size, np.ones(len(objects), dtype=np.bool_))

    def beside(self, objects: Windows) -> Mask:
        """Which windows (n,) neither contain the center of an object, nor have their own center in one."""
        shift = objects.centers - self.centers[:, None]
        larger = np.maximum(self.radii[:, None], objects.radii)
        return np.asarray((np.hypot(shift[..., 0], shift[..., 1]) > larger).all(axis=1))


def jittered_windows(
    objects: Windows, count: int, jitter: float, size_jitter: float, random: np.random.Generator
) -> Windows:
    """`count` windows for each object, up to `jitter` of its radii from its center, with a radius that differs by a
    factor of up to exp(`size_jitter`)."""
    repeated = objects.part(np.repeat(np.arange(len(objects)), count))
    distance, angle, size = random.random((3, len(repeated)))
    off, angle = jitter * np.sqrt(distance), 2.0 * np.pi * angle
    moved = repeated.moved(off * np.cos(angle), off * np.sin(angle))
    return Windows(moved.centers, moved.radii * np.exp(size_jitter * (2.0 * size - 1.0)))


def random_windows(size: Size, radii: Floats, count: int, random: np.random.Generator) -> Windows:
    """`count` windows anywhere in a picture of a size [px], with radii between the smallest and the largest of
    `radii` [px]."""
    x, y, scale = random.random((3, count))
    low, high = np.log(radii.min()), np.log(radii.max())
    centers = np.stack([x, y], axis=1) * size - 0.5
    return Windows(centers, np.exp(low + (high - low) * scale))


def grid_windows(size: Size, radii: Floats) -> Windows:
    """Windows of these radii (s,) all over a picture of a size [px], one radius apart."""
    parts = [Windows.none()]
    for radius in radii.tolist():
        x, y = (np.arange(0.5 * radius, side, radius) - 0.5 for side in size)
        centers = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        parts.append(Windows(centers, np.full(len(centers), radius)))
    return Windows.joined(*parts)
