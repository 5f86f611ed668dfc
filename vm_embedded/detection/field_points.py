"""From an observation to the features of the field."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..field.features import FieldFeatures
from ..field.find import find_features
from ..field.ground_points import ROLES, GroundPoints
from .looking import Look
from .observation import Observation
from .profiles import brightness_along
from .settings import Settings
from .upright_bases import find_uprights

_LOWEST = 1e-3
"""Rays less steep than this do not meet the plane near enough to matter."""


def locate_features(observation: Observation, looks: Mapping[str, Look], settings: Settings) -> FieldFeatures | None:
    """Goal posts, robots, lines and border; None if the network has no class for any of them.

    looks: look networks by class. Only a network with peaks for them shows posts and robots. Raises ModelError if a
    look network does not run.
    """
    names = [each.name for each in observation.manifest.classes]
    if not set(ROLES) & set(names):
        return None
    view, pyramid = observation.view, observation.pyramid
    posts, robots = (
        find_uprights(observation, name, looks.get(name), settings) if name in observation.manifest.peaks else ()
        for name in ("goal", "robot")
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
    view, classes = observation.view, observation.manifest.classes
    rays = observation.mesh_rays.T
    upward = rays[2]
    order = np.argsort(upward, kind="stable")  # the mesh is nearly in this order
    order = order[: np.searchsorted(upward, -_LOWEST, sorter=order)]
    positions = np.take(rays[:2], order, axis=1) * (-view.height / upward[order])
    columns = [  # 0 for NaN: one NaN would spoil the sums of all others
        (each, np.fmax(column[order], 0.0))
        for each, column in zip(classes, observation.probabilities.T, strict=True)
        if each.kind == "background" or each.name in ROLES
    ]
    return GroundPoints(
        positions=(view.heading[:2, :2] @ positions).T,
        height=view.height,
        across=view.shape.radius * view.ring_spacing,
        classes={each.name: column for each, column in columns if each.name in ROLES},
        outside=sum(
            (column for each, column in columns if each.kind == "background"), np.zeros(len(order), np.float32)
        ),
        ahead=view.heading[:2, 0],
    )
