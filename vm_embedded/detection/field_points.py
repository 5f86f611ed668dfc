"""From an observation to the features of the field."""

from __future__ import annotations

from collections.abc import Mapping
from weakref import WeakKeyDictionary

import numpy as np

from ..field.features import FieldFeatures, Upright
from ..field.find import find_features
from ..field.ground_points import ROLES, GroundMap, GroundPoints, ground_map
from ..network.layout import Layout
from .looking import Look
from .observation import Observation
from .profiles import brightness_along
from .settings import Settings
from .upright_bases import find_uprights

_MAPS: WeakKeyDictionary[Layout, GroundMap] = WeakKeyDictionary()
"""Where the rays of layouts meet the plane, as long as a cache keeps these."""


def locate_features(observation: Observation, looks: Mapping[str, Look], settings: Settings) -> FieldFeatures | None:
    """Goal posts, robots, lines and border; None if the network has no class for any of them.

    looks: look networks by class. Only a network with peaks for them shows posts and robots. Raises ModelError if a
    look network does not run.
    """
    names = [each.name for each in observation.manifest.classes]
    if not set(ROLES) & set(names):
        return None
    view, pyramid = observation.view, observation.pyramid

    def uprights(name: str) -> tuple[Upright, ...]:
        look = looks.get(name)
        best = observation.peaks[name].part(slice(1)) if name in observation.manifest.peaks else ()
        if not best or (look is None and best.probabilities[0] < settings.min_confidence):
            return ()
        return find_uprights(observation, name, look, settings)

    return find_features(
        ground_points(observation),
        view.picture_pixels,
        lambda stretches, count: brightness_along(view, pyramid, stretches, count),
        uprights("goal"),
        uprights("robot"),
    )


def ground_points(observation: Observation) -> GroundPoints:
    """The points of an observation on the plane."""
    view, layout = observation.view, observation.layout
    ground = _MAPS.get(layout)
    if ground is None:
        ground = _MAPS[layout] = ground_map(layout.rays, layout.places)
    classes = observation.manifest.classes
    names = [each.name for each in classes]
    signs = [-1.0 if each.kind == "background" else float(each.name in ("field", "line")) for each in classes]
    probabilities = observation.slot_probabilities.T
    return GroundPoints(
        map=ground,
        shown=observation.projected.on_screen,
        line=probabilities[names.index("line")] if "line" in names else np.zeros(len(layout), np.float32),
        inside=np.array(signs, dtype=np.float32) @ probabilities if "field" in names else None,
        height=view.height,
        across=view.shape.radius * view.ring_spacing,
        heading=view.heading[:2, :2],
    )
