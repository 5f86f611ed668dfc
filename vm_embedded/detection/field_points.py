"""From an observation to the features of the field."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from ..field.features import FieldFeatures
from ..field.find import find_features
from ..field.ground_points import ROLES, GroundMap, GroundPoints, ground_map
from ..mesh.mesh import Mesh
from .looking import Judged
from .observation import Observation
from .profiles import brightness_along
from .upright_bases import uprights_at

_MAPS: WeakKeyDictionary[Mesh, GroundMap] = WeakKeyDictionary()
"""Where the rays of meshes meet the plane, as long as a cache keeps these."""


def locate_features(observation: Observation, judged: Judged) -> FieldFeatures | None:
    """Goal posts, robots, lines and border; None if the network has no class for any of them.

    judged: what is at the peaks; only a network with peaks for them shows posts and robots.
    """
    names = [each.name for each in observation.manifest.classes]
    if not set(ROLES) & set(names):
        return None
    view, pyramid = observation.view, observation.pyramid
    posts, robots = (
        uprights_at(name, judged[name][0].view, judged[name][1]) if name in judged else () for name in ("goal", "robot")
    )
    return find_features(
        ground_points(observation),
        view.picture_pixels,
        lambda stretches, count: brightness_along(view, pyramid, stretches, count),
        posts,
        robots,
    )


def ground_points(observation: Observation) -> GroundPoints:
    """The points of an observation on the plane."""
    view, mesh, answered = observation.view, observation.view.mesh, observation.projected.answered
    ground = _MAPS.get(mesh)
    if ground is None:
        core = np.arange(len(mesh)) if mesh.margin is None else np.flatnonzero(~mesh.margin)
        ground = _MAPS[mesh] = ground_map(mesh.rays, core)
    classes = observation.manifest.classes
    names = [each.name for each in classes]
    signs = [-1.0 if each.kind == "background" else float(each.name in ("field", "line")) for each in classes]
    weights = np.array([[float(each == "line") for each in names], signs], dtype=np.float32)
    values = np.zeros((2, len(mesh)), dtype=np.float32)
    # One NaN would spoil the sums of all others.
    values[:, answered] = weights @ np.fmax(observation.probabilities.T, np.float32(0.0))
    return GroundPoints(
        map=ground,
        shown=observation.projected.core,
        line=values[0],
        inside=values[1] if "field" in names else None,
        height=view.height,
        across=view.shape.radius * view.ring_spacing,
        heading=view.heading[:2, :2],
    )
