"""From an observation to the features of the field."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import cv2
import numpy as np

from ..arrays import Floats, Singles
from ..field.features import FieldFeatures
from ..field.find import find_features
from ..field.ground_points import ROLES, GroundPoints
from ..field.uprights import KINDS as UPRIGHTS
from .looking import Look
from .observation import Observation
from .prepared_view import PreparedView
from .pyramid import Pyramid
from .settings import Settings
from .upright_looks import find_bases
from .upright_peaks import peak_bases

_LOWEST = 1e-3
"""Rays less steep than this do not meet the plane near enough to matter."""


def locate_features(observation: Observation, looks: Mapping[str, Look], settings: Settings) -> FieldFeatures | None:
    """Goal posts, robots, lines and border; None if the network has no class for any of them.

    looks: look networks for classes of uprights, by class. Peaks show the uprights of the other classes, and rules find
    those of classes without peaks. Raises ModelError if a look network does not run.
    """
    names = [each.name for each in observation.manifest.classes]
    if not set(ROLES) & set(names):
        return None
    view, pyramid = observation.view, observation.pyramid
    uprights = [name for name in observation.manifest.peaks if name in UPRIGHTS and name not in looks]
    bases = {name: peak_bases(observation, name, settings) for name in uprights}
    bases |= {name: find_bases(observation, look, settings) for name, look in looks.items()}
    return find_features(
        ground_points(observation),
        lambda places: _pixels(view, places),
        lambda stretches, count: brightness_along(view, pyramid, stretches, count),
        bases,
    )


def ground_points(observation: Observation) -> GroundPoints:
    """The points of an observation on the plane."""
    view, classes = observation.view, observation.manifest.classes
    rays = observation.layout.rays.T
    upward = rays[2, observation.shown]
    order = np.argsort(upward, kind="stable")  # the mesh is nearly in this order
    order = order[: np.searchsorted(upward, -_LOWEST, sorter=order)]
    slots, scale = observation.shown[order], -view.height / upward[order]
    positions = np.array([rays[0, slots] * scale, rays[1, slots] * scale])
    columns = [  # 0 for NaN: one NaN would spoil the sums of all others
        (each, np.fmax(column[slots], 0.0))
        for each, column in zip(classes, observation.slot_probabilities.T, strict=True)
        if each.kind == "background" or each.name in ROLES
    ]
    return GroundPoints(
        positions=(view.heading[:2, :2] @ positions).T,
        height=view.height,
        across=view.shape.radius * view.ring_spacing,
        classes={each.name: column for each, column in columns if each.name in ROLES},
        outside=sum(
            (column for each, column in columns if each.kind == "background"), np.zeros(len(slots), np.float32)
        ),
        ahead=view.heading[:2, 0],
    )


def _pixels(view: PreparedView, places: Floats) -> Floats:
    """Pixels (n, 2) of places (n, 2) [m] on the plane; NaN where the frame does not show them."""
    pixels = view.plane_pixels(places)
    return np.where(view.in_picture(pixels)[:, None], pixels, np.nan)


_MEAN = np.array([[1.0, 1.0, 1.0, 0.0]]) / 3.0
"""Shares of the channels in the brightness; the last one is alpha, if there is one."""


def brightness_along(view: PreparedView, pyramid: Pyramid, stretches: Floats, count: int) -> tuple[Singles, Floats]:
    """Brightness (n, count), 0 to 255, at evenly spaced places from one end to the other of stretches (n, 2, 2) [m] on
    the plane, from below the camera, NaN outside of the picture, and the pixels (n,) between two of these places.

    view: of the frame. pyramid: the frame; only its first level is read. The lens projects both ends and the middle of
    each stretch; a parabola through them gives the other places.
    """
    nodes = np.concatenate([stretches[:, 0], 0.5 * (stretches[:, 0] + stretches[:, 1]), stretches[:, 1]])
    known = view.plane_pixels(nodes).T.reshape(2, 3, -1)  # x and y of the nodes
    x, y = pixels = known.transpose(0, 2, 1).astype(np.float32) @ _shares(count).T  # (2, n, count)
    width, height = view.size
    hidden = ~((x >= 0.0) & (x <= width - 1.0) & (y >= 0.0) & (y <= height - 1.0))
    pixels[:, hidden] = -1.0
    colors = cv2.remap(pyramid.level(0), x, y, cv2.INTER_LINEAR)
    gray = colors if colors.ndim == 2 else cv2.transform(colors, _MEAN[:, : colors.shape[2]])
    brightness = gray.astype(np.float32)
    brightness[hidden] = np.nan
    along = known[:, 2] - known[:, 0]
    return brightness, np.nan_to_num(np.hypot(along[0], along[1]) / (count - 1))


@lru_cache(maxsize=4)
def _shares(count: int) -> Singles:
    """Shares (count, 3) of the two ends and the middle between them in evenly spaced places."""
    at = np.linspace(0.0, 1.0, count, dtype=np.float32)
    return np.stack([(1.0 - at) * (1.0 - 2.0 * at), 4.0 * at * (1.0 - at), at * (2.0 * at - 1.0)], axis=1)
