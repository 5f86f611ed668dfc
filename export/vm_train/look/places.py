"""The places that patches are cut at: peaks of the mesh network, places beside true objects, and random places."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image
from vm_embedded.detection.observation import Observation
from vm_embedded.detection.patches import Tangents, cut_patches, patch_nodes
from vm_embedded.detection.prepared_view import PreparedView
from vm_embedded.detection.pyramid import Pyramid

from .configuration import PatchSettings
from .labels import VISIBLE, Truths

_DRAWS = 4
"""Pixels to draw for each random place; many of them show no plane."""


@dataclass(frozen=True, eq=False)
class PatchPlaces:
    """n places: centers (n, 3) relative to the camera in the mesh frame [m], and factors (n,) by which their patches
    are larger than the object that is expected there needs."""

    centers: Floats
    factors: Floats

    def __len__(self) -> int:
        return len(self.centers)

    @classmethod
    def of(cls, centers: Floats) -> PatchPlaces:
        """Places with factor 1."""
        return cls(centers, np.ones(len(centers)))

    def __add__(self, other: PatchPlaces) -> PatchPlaces:
        return PatchPlaces(np.concatenate([self.centers, other.centers]), np.concatenate([self.factors, other.factors]))

    def part(self, chosen: npt.NDArray[np.bool_]) -> PatchPlaces:
        """The places of a mask (n,)."""
        return PatchPlaces(self.centers[chosen], self.factors[chosen])

    def tangents(self, view: PreparedView) -> Tangents:
        """The planes of their patches; the radius includes the factor."""
        found = Tangents.at(view, self.centers)
        return replace(found, radius=found.radius * self.factors)

    def cut(self, pyramid: Pyramid, view: PreparedView, settings: PatchSettings) -> Image:
        """Their patches (n, size, size, 3), RGB."""
        return cut_patches(pyramid, patch_nodes(view, self.tangents(view), settings.extent), settings.size)


def jittered_places(
    view: PreparedView, truths: Truths, settings: PatchSettings, random: np.random.Generator
) -> PatchPlaces:
    """Places up to `jitter` radii from true objects of which enough is visible, in turn, with factors of the size."""
    chosen = np.flatnonzero(truths.visible >= VISIBLE)
    distance, angle, size = random.random((3, settings.jittered))
    if not len(chosen):
        return PatchPlaces.of(np.empty((0, 3)))
    chosen = chosen[np.arange(settings.jittered) % len(chosen)]
    objects = Tangents.at(view, truths.centers[chosen])
    off, angle = settings.jitter * np.sqrt(distance), 2.0 * np.pi * angle
    rays = objects.rays(off * np.cos(angle), off * np.sin(angle))
    factors = np.exp(settings.size_jitter * (2.0 * size - 1.0))
    below = rays[:, 2] < 0.0
    return PatchPlaces(view.shape.center_along(rays[below], view.height), factors[below])


def random_places(
    observation: Observation, view: PreparedView, settings: PatchSettings, random: np.random.Generator
) -> PatchPlaces:
    """Places on the plane at random pixels of the picture, as far as the mesh reaches. view: of the objects there."""
    pixels = random.random((_DRAWS * settings.random, 2)) * view.size - 0.5
    rays = view.lens.unproject(pixels, view.size) @ view.rotation.T
    rays = rays[np.isfinite(rays).all(axis=1)]
    centers = view.shape.center_along(rays[rays[:, 2] < 0.0], view.height)
    near = np.hypot(centers[:, 0], centers[:, 1]) < observation.manifest.max_distance
    return PatchPlaces.of(centers[near][: settings.random])
