"""From a frame to points with probabilities: project, sample, infer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Protocol

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from ..network.canvas_layout import CanvasLayout
from ..network.layout import Layout
from ..network.manifest import Manifest
from .peaks import Peaks, peaks_of
from .prepared_view import PreparedView
from .projection import Projection, project
from .pyramid import Pyramid
from .sampling import normalized, normalized_canvas, sample, sample_strips
from .settings import Settings


class Classifier(Protocol):
    """Anything that gives points their probabilities: a Session, or a network in torch."""

    def run(self, layout: Layout, colors: Singles, on_screen: Mask, points: Chosen) -> Singles:
        """All outputs (k, outputs) for points (k,) on screen; see `Manifest.outputs`.

        colors (3, m): of the places of a layout. on_screen (n,): which points of the mesh are on screen.
        """


@dataclass(frozen=True, eq=False)
class Observation:
    """A frame's n points on screen with their probabilities, before objects are located among them.

    All are in the order of the mesh. pyramid: the frame. view: its mesh, lens and orientation. manifest: of the
    network. projected: the view's mesh in the picture; the n points are `Projection.answered`. answers (n, outputs):
    the network's outputs, as `Manifest.outputs` counts them. timing_ms: time of each stage [ms].
    """

    pyramid: Pyramid
    view: PreparedView
    manifest: Manifest
    projected: Projection
    answers: Singles
    timing_ms: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.answers)

    @cached_property
    def pixels(self) -> Floats:
        """Pixels (n, 2) of the points."""
        return self.projected.pixels[self.projected.answered]

    @cached_property
    def mesh_rays(self) -> Floats:
        """Unit vectors (n, 3) from the camera to the points, in the mesh frame, column by column in memory."""
        return np.take(self.view.mesh.rays.T, self.projected.answered, axis=1).T

    @cached_property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) from the camera to the points, in the plane's frame, as in Detection."""
        return np.asarray(self.mesh_rays @ self.view.heading.T)

    @property
    def probabilities(self) -> Singles:
        """Probabilities (n, C) of the points, in the order of the manifest's classes."""
        return self.answers[:, : len(self.manifest.classes)]

    @cached_property
    def peaks(self) -> Mapping[str, Peaks]:
        """The peaks of each class that the network has peaks for (`Manifest.peaks`), best first."""
        return peaks_of(self.answers, self.projected.answered, self.view, self.manifest)


def observe(
    pyramid: Pyramid, view: PreparedView, manifest: Manifest, network: Classifier, settings: Settings, watch: Stopwatch
) -> Observation:
    """Project the view's points into the frame and classify them.

    watch: gets the stages project, sample and infer. Raises ModelError if the network does not run.
    """
    projected = project(view.mesh, view.rotation, view.lens, view.size)
    watch.lap("project")
    return classify(pyramid, view, projected, manifest, network, settings, watch)


def classify(
    pyramid: Pyramid,
    view: PreparedView,
    projected: Projection,
    manifest: Manifest,
    network: Classifier,
    settings: Settings,
    watch: Stopwatch,
) -> Observation:
    """Sample the frame at projected points, and let the network classify them. See `observe`."""
    layout = view.layout
    counted = layout.spread(projected.core)  # strips overlap in their margins, which must not count twice in the mean
    if isinstance(layout, CanvasLayout):
        canvas = sample_strips(pyramid, projected.pixels, view.levels, layout, projected.on_screen)
        colors = normalized_canvas(canvas, pyramid.channels, manifest.colors, counted)
    else:
        colors = normalized(sample(pyramid, projected.pixels, view.levels), manifest.colors, counted)
    watch.lap("sample")
    answers = network.run(layout, colors, projected.on_screen, projected.answered)
    watch.lap("infer")
    return Observation(pyramid, view, manifest, projected, answers, watch.stages)


class Stopwatch:
    """Milliseconds of each stage, in the order in which the stages ended. It starts when it is made."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """End a stage: its time is that since the stage before ended."""
        now = perf_counter()
        self.stages[stage] = 1e3 * (now - self._last)
        self._last = now
