"""From a frame to points with probabilities: project, sample, infer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Protocol

import numpy as np

from ..arrays import Floats, Indices, Mask, Singles
from ..network.canvas_layout import CanvasLayout
from ..network.layout import Layout
from ..network.manifest import Manifest
from .peaks import Peaks, peaks_of
from .prepared_view import PreparedView
from .projection import Projection, project
from .pyramid import Pyramid
from .sampling import normalized, sample
from .settings import Settings
from .strip_sampling import sample_strips


class Network(Protocol):
    """Anything that gives points their probabilities: a Session, or a network in torch."""

    def run(self, layout: Layout, colors: Singles, on_screen: Mask) -> Singles:
        """All outputs (m, outputs) for a layout's slots, from their colors (3, m) and which slots (m,) are on screen.

        See `Manifest.outputs`.
        """


@dataclass(frozen=True, eq=False)
class Observation:
    """A frame's n points on screen with their probabilities, before objects are located among them.

    pyramid: the frame. view: its mesh points, lens and orientation. manifest: of the network. projected: pixels of the
    m slots of the layout. A slot is one place in the network's input; it holds a point, a copy of a point, or nothing.
    Only original points count as on screen. slot_answers (m, outputs): the network's outputs, as `Manifest.outputs`
    counts them; they have no meaning for slots off screen. timing_ms: time of each stage [ms].
    """

    pyramid: Pyramid
    view: PreparedView
    manifest: Manifest
    projected: Projection[Layout]
    slot_answers: Singles
    timing_ms: Mapping[str, float] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.shown)

    @property
    def layout(self) -> Layout:
        """The network's order of the points."""
        return self.view.layout

    @property
    def slot_probabilities(self) -> Singles:
        """Probabilities (m, C) of the slots."""
        return self.slot_answers[:, : len(self.manifest.classes)]

    @cached_property
    def shown(self) -> Indices:
        """Slots (n,) of the points on screen, in the order of the mesh."""
        places = self.layout.places
        return places[self.projected.on_screen[places]]

    @cached_property
    def pixels(self) -> Floats:
        """Pixels (n, 2) of the points."""
        return self.projected.pixels[self.shown]

    @cached_property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) from the camera to the points, in the plane's frame, as in Detection."""
        return np.asarray(self.layout.rays[self.shown] @ self.view.heading.T)

    @cached_property
    def probabilities(self) -> Singles:
        """Probabilities (n, C) of the points, in the order of the manifest's classes."""
        return self.slot_probabilities[self.shown]

    def find_peaks(self, class_name: str, most: int) -> Peaks:
        """At most `most` peaks of a class that the network has peaks for (`Manifest.peaks`), best first."""
        return self._peaks[class_name].part(slice(most))

    @cached_property
    def _peaks(self) -> Mapping[str, Peaks]:
        return peaks_of(self.slot_answers, self.projected.on_screen, self.view, self.manifest)


def observe(
    pyramid: Pyramid, view: PreparedView, manifest: Manifest, network: Network, settings: Settings, watch: Stopwatch
) -> Observation:
    """Project the view's points into the frame and classify them.

    watch: gets the stages project, sample and infer. Raises ModelError if the network does not run.
    """
    projected = project(view.layout, view.rotation, view.lens, view.size)
    watch.lap("project")
    return classify(pyramid, view, projected, manifest, network, settings, watch)


def classify(
    pyramid: Pyramid,
    view: PreparedView,
    projected: Projection[Layout],
    manifest: Manifest,
    network: Network,
    settings: Settings,
    watch: Stopwatch,
) -> Observation:
    """Sample the frame at projected points, and let the network classify them. See `observe`."""
    layout = view.layout
    # The network needs the colors of copies, too. They must not count twice in the mean color, nor in an object.
    shown = projected.only(layout.original)
    if isinstance(layout, CanvasLayout):
        sampled = sample_strips(pyramid, projected.pixels, view.levels, layout)
    else:
        sampled = sample(pyramid, projected.pixels, view.levels)
    colors = normalized(sampled, manifest.colors, shown.on_screen)
    watch.lap("sample")
    answers = network.run(layout, colors, projected.on_screen)
    watch.lap("infer")
    return Observation(pyramid, view, manifest, shown, answers, watch.stages)


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
