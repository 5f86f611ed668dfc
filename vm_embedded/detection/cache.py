"""Prepared work: which part of which mesh can be on screen, for a bucket of similar orientations.

A bucket never changes an answer. It holds every point that any orientation in it can bring on screen, and each frame
is projected with its own orientation; only the mesh itself depends on the bucket's height, by the tolerance that the
user sets.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ..arrays import Floats, Mask
from ..geometry.lens import Lens, Size
from ..geometry.orientation import Orientation, rotation_z
from ..mesh.mesh import Mesh
from ..network.choose_layout import choose_layout
from ..network.layout import Layout
from ..network.manifest import Manifest
from .footprint import Levels, levels_of
from .projection import may_be_on_screen
from .settings import Settings

_Kept = TypeVar("_Kept", Mesh, "Prepared")

_ROUNDING = 2e-3
"""Slack [rad] for rotations that are not quite rotations, as far as Orientation lets them pass."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a bucket keeps: the points that may be on screen, as the network takes them, and which of them are colored
    by which picture, if the network is for footprints."""

    layout: Layout
    levels: Levels | None

    @property
    def nbytes(self) -> int:
        """Memory that it holds [bytes]."""
        return self.layout.nbytes + sum(each.nbytes for each in self.levels or ())


@dataclass(frozen=True, eq=False)
class View:
    """What a frame is projected with.

    layout: the points that may be on screen, as the network takes them. levels: which of them are colored by which
    picture, or None. mesh_height: the camera height that their mesh was built for [m]. rotation (3, 3): camera to mesh
    frame. heading (3, 3): mesh frame to the frame's observation plane, a turn around the vertical.
    """

    layout: Layout
    levels: Levels | None
    mesh_height: float
    rotation: Floats
    heading: Floats


class MeshCache:
    """Least recently used meshes and parts of meshes, up to a limit of memory.

    `hits`, `misses` and `nbytes` [bytes] may be read at any time.
    """

    def __init__(self, manifest: Manifest, settings: Settings) -> None:
        self.manifest = manifest
        self.settings = settings
        self.shape = manifest.mesh_shape
        self.hits = 0
        self.misses = 0
        self.nbytes = 0
        self._limit = settings.cache_mib * 2**20
        self._kept: OrderedDict[Hashable, Any] = OrderedDict()

    @property
    def hit_rate(self) -> float:
        """Share of look-ups that needed no preparation; 0 before the first."""
        return self.hits / max(self.hits + self.misses, 1)

    def view(self, orientation: Orientation, lens: Lens, size: Size) -> View:
        """The view for a frame. Raises GeometryError if the camera is too low for the mesh's shape."""
        height = self.mesh_height(orientation.height)
        if self.settings.height_tolerance == 0.0:
            mesh = self._look_up(height, lambda: self._build(height))
            part = mesh.part(np.flatnonzero(may_be_on_screen(mesh, orientation.rotation, lens, size, _ROUNDING)))
            made = self._prepared(part, height, lens, size)
            return View(made.layout, made.levels, height, orientation.rotation, np.eye(3))
        pitch = round(orientation.pitch / self.settings.pitch_step)
        roll = round(orientation.roll / self.settings.roll_step)
        key = (height, pitch, roll, lens, size)
        kept = self._look_up(key, lambda: self._prepare(height, pitch, roll, lens, size))
        return View(kept.layout, kept.levels, height, orientation.level, rotation_z(orientation.yaw))

    def mesh_height(self, height: float) -> float:
        """Height [m] of the mesh that serves a camera height [m], within the tolerance of the settings."""
        tolerance, k = self.settings.height_tolerance, self.manifest.intersections
        return self.manifest.model.mesh_height(self.shape, height, k, tolerance)

    def _build(self, height: float) -> Mesh:
        manifest = self.manifest
        return manifest.model.build(self.shape, height, manifest.intersections, manifest.max_distance)

    def _prepare(self, height: float, pitch: int, roll: int, lens: Lens, size: Size) -> Prepared:
        """What orientations of this bucket can bring on screen.

        Turns around two axes add up to at most the sum of their angles. That is the slack of the bucket's middle; the
        middles of its quarters have half of it, and leave fewer points that no orientation needs.
        """
        mesh = self._look_up(height, lambda: self._build(height), counted=False)
        steps = self.settings.pitch_step, self.settings.roll_step

        def possible(mesh: Mesh, pitch: float, roll: float, share: float) -> Mask:
            middle = Orientation.from_roll_pitch(height, roll * steps[1], pitch * steps[0])
            return may_be_on_screen(mesh, middle.rotation, lens, size, share * sum(steps) + _ROUNDING)

        mesh = mesh.part(np.flatnonzero(possible(mesh, pitch, roll, 0.5)))
        quarters = [possible(mesh, pitch + up, roll + lean, 0.25) for up in (-0.25, 0.25) for lean in (-0.25, 0.25)]
        return self._prepared(mesh.part(np.flatnonzero(np.any(quarters, axis=0))), height, lens, size)

    def _prepared(self, mesh: Mesh, height: float, lens: Lens, size: Size) -> Prepared:
        layout = choose_layout(mesh, self.manifest)
        if self.manifest.sampling == "bilinear":
            return Prepared(layout, None)
        scale = lens.for_image(size).scale
        return Prepared(layout, levels_of(layout.rays, self.shape, height, self.manifest.intersections, scale))

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
