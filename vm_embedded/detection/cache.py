"""Meshes and their parts that can be on screen, kept for buckets of similar orientations.

A bucket does not change the answer. It holds every point that any of its orientations can bring on screen, and each
frame is projected with its own orientation. Only the mesh depends on the bucket's height, within a tolerance that the
user sets.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..arrays import Mask
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation, rotation_z
from ..mesh.mesh import Mesh
from ..network.choose_layout import choose_layout
from ..network.layout import Layout
from ..network.manifest import Manifest
from .footprint import Levels, levels_for
from .prepared_view import PreparedView
from .projection import may_be_on_screen
from .settings import Settings

_Kept = TypeVar("_Kept", Mesh, "PreparedPoints")

_ROUNDING = 2e-3
"""Slack [rad] for rotation matrices with the rounding errors that Orientation accepts."""


@dataclass(frozen=True, eq=False)
class PreparedPoints:
    """The part of a mesh that a bucket keeps: the points that may be on screen, how the network takes them, and for
    each the level of the image pyramid (how often the image is halved) that gives its color."""

    mesh: Mesh
    layout: Layout
    levels: Levels

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.mesh.nbytes + self.layout.nbytes + self.levels.nbytes


class MeshCache:
    """Keeps meshes and parts of meshes up to a limit of memory; it drops the least recently used first.

    A mesh is kept under its height, and the prepared points of a bucket under (height, pitch, roll, lens, size), with
    pitch and roll as numbers of steps.

    `hits`, `misses`, `prepared` (buckets that `prepare_nearby` made) and `nbytes` [bytes] may be read at any time.
    """

    def __init__(self, manifest: Manifest, settings: Settings) -> None:
        self.manifest = manifest
        self.settings = settings
        self.shape = manifest.mesh_shape
        self.hits = 0
        self.misses = 0
        self.prepared = 0
        self.nbytes = 0
        self._limit = settings.cache_mib * 2**20
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()

    @property
    def hit_rate(self) -> float:
        """Share of look-ups that found prepared points, or meshes if the height tolerance is 0; 0 before the first."""
        return self.hits / max(self.hits + self.misses, 1)

    def view(self, orientation: Orientation, lens: Lens, size: Size) -> PreparedView:
        """The view for a frame. lens: fitted to an image of that size [px].

        Raises GeometryError if the camera is too low for the mesh's shape.
        """
        height = self.mesh_height(orientation.height)
        if self.settings.height_tolerance == 0.0:
            # As in the reference: a mesh for each exact height, no buckets, and no turn of the mesh with the yaw.
            mesh = self._look_up(height, lambda: self._build(height))
            possible = may_be_on_screen(mesh, orientation.rotation, lens, size, _ROUNDING)
            points, rotation, heading = self._prepared(mesh, possible, height, lens), orientation.rotation, np.eye(3)
        else:
            pitch = round(orientation.pitch / self.settings.pitch_step)
            roll = round(orientation.roll / self.settings.roll_step)
            key = (height, pitch, roll, lens, size)
            points = self._look_up(key, lambda: self._prepare_bucket(height, pitch, roll, lens, size))
            rotation, heading = orientation.level, rotation_z(orientation.yaw)
        return PreparedView(
            mesh=points.mesh,
            layout=points.layout,
            levels=points.levels,
            shape=self.manifest.object_shape,
            rings=self.manifest.rings_across(height, orientation.height),
            height=orientation.height,
            rotation=rotation,
            heading=heading,
            lens=lens,
            size=size,
        )

    def prepare_nearby(self, orientation: Orientation, lens: Lens, size: Size) -> bool:
        """Prepare the nearest bucket that is missing around an orientation's own; return whether one was prepared.

        A walking robot soon needs it. Only buckets that touch the orientation's own one count. lens: fitted to an image
        of that size [px]. It drops nothing from the memory. It does nothing if memory is short, if the mesh or the
        orientation's own bucket is not kept, or if the height tolerance is 0. Raises GeometryError if the camera is
        too low for the mesh's shape.
        """
        height = self.mesh_height(orientation.height)
        pitch_steps = orientation.pitch / self.settings.pitch_step
        roll_steps = orientation.roll / self.settings.roll_step
        own = self._kept.get((height, round(pitch_steps), round(roll_steps), lens, size))
        # A neighbor is about as large as the own bucket. With less room than for one and a half, it would often be
        # prepared in vain.
        if own is None or height not in self._kept or self.nbytes + 1.5 * own.nbytes > self._limit:
            return False
        around = [(round(pitch_steps) + i, round(roll_steps) + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        for pitch, roll in sorted(around, key=lambda each: math.hypot(each[0] - pitch_steps, each[1] - roll_steps)):
            key = (height, pitch, roll, lens, size)
            if key not in self._kept:
                points = self._prepare_bucket(height, pitch, roll, lens, size)
                if self.nbytes + points.nbytes > self._limit:
                    return False
                self._kept[key] = points
                self.nbytes += points.nbytes
                self.prepared += 1
                return True
        return False

    def mesh_height(self, height: float) -> float:
        """Height [m] of the mesh for a camera height [m], within the tolerance of the settings."""
        tolerance, k = self.settings.height_tolerance, self.manifest.intersections
        return self.manifest.model.mesh_height(self.shape, height, k, tolerance)

    def _build(self, height: float) -> Mesh:
        manifest = self.manifest
        return manifest.model.build(self.shape, height, manifest.intersections, manifest.max_distance)

    def _prepare_bucket(self, height: float, pitch: int, roll: int, lens: Lens, size: Size) -> PreparedPoints:
        """The points that an orientation of this bucket can bring on screen.

        The bucket is tested in four quarters. An orientation differs from the bucket's middle by at most half a step of
        pitch plus half a step of roll, and from the middle of its quarter by half of that. So four tests of quarters
        keep fewer points than one of the whole bucket. That one goes first only to save time: it leaves fewer points
        for the others.
        """
        mesh = self._look_up(height, lambda: self._build(height), counted=False)
        pitch_step, roll_step = self.settings.pitch_step, self.settings.roll_step

        def possible(points: Mesh, pitched: float, rolled: float, half_width: float) -> Mask:
            """Which points may be on screen in a piece of the bucket.

            Its middle is `pitched` pitch steps and `rolled` roll steps from the bucket's middle. It reaches
            `half_width` steps to each side.
            """
            middle = Orientation.from_roll_pitch(height, (roll + rolled) * roll_step, (pitch + pitched) * pitch_step)
            slack = half_width * (pitch_step + roll_step) + _ROUNDING
            return may_be_on_screen(points, middle.rotation, lens, size, slack)

        part = mesh.part(np.flatnonzero(possible(mesh, 0.0, 0.0, 0.5)))
        quarters = [possible(part, pitched, rolled, 0.25) for pitched in (-0.25, 0.25) for rolled in (-0.25, 0.25)]
        return self._prepared(part, np.any(quarters, axis=0), height, lens)

    def _prepared(self, mesh: Mesh, possible: Mask, height: float, lens: Lens) -> PreparedPoints:
        """The points of a mesh that may be on screen (n,), as far as the network needs them."""
        mesh = mesh.part(np.flatnonzero(mesh.needed(possible)))
        return PreparedPoints(mesh, choose_layout(mesh, self.manifest), levels_for(self.manifest, mesh, height, lens))

    def _look_up(self, key: Hashable, make: Callable[[], _Kept], counted: bool = True) -> _Kept:
        kept: _Kept | None = self._kept.get(key)
        if counted:
            self.hits += kept is not None
            self.misses += kept is None
        if kept is None:
            kept = self._kept[key] = make()
            self.nbytes += kept.nbytes
        self._kept.move_to_end(key)
        while self.nbytes > self._limit and self._kept:
            self.nbytes -= self._kept.popitem(last=False)[1].nbytes
        return kept
