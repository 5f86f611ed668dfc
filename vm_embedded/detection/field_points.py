"""From an observation to the features of the field.

The detector knows the picture, `field` the plane: this gives it the points on the plane, the brightness of the picture
along short stretches of it, and the goal posts and robots, each where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from weakref import WeakKeyDictionary

import cv2
import numpy as np

from ..arrays import Floats, Singles
from ..field.features import UPRIGHTS, FieldFeatures, Upright
from ..field.find import find_features
from ..field.ground_points import ROLES, GroundMap, GroundPoints, ground_map
from ..mesh.mesh import Mesh
from .looking import Judged, Judgment
from .observation import Observation
from .peaks import first_apart
from .prepared_view import PreparedView
from .pyramid import Pyramid

_SAME = 0.12
"""Two bases nearer to each other than this share of their distance are those of one thing: far away, a small error in
the picture is a large one on the plane."""

_MEAN = np.array([[1.0, 1.0, 1.0, 0.0]]) / 3.0
"""Shares of the channels in the brightness; the last one is alpha, if there is one."""

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


def uprights_at(class_name: str, view: PreparedView, judged: Sequence[Judgment]) -> tuple[Upright, ...]:
    """The uprights of a class that were judged to be there, nearest first. view: see `around_bases`."""
    judged = [each for each in judged if each.reason is None]
    centers = np.array([each.center for each in judged]).reshape(-1, 3) @ view.heading.T
    widths = [2.0 * view.shape.radius * each.scale for each in judged]
    pixels = view.picture_pixels(centers[:, :2])
    found = []
    for center, width, pixel, each in zip(centers, widths, pixels, judged, strict=True):
        distance = float(np.linalg.norm(center))
        found.append(
            Upright(UPRIGHTS[class_name], each.confidence, center[:2], distance, center / distance, pixel, width)
        )
    return apart(found) if len(found) > 1 else tuple(found)


def apart(uprights: Sequence[Upright]) -> tuple[Upright, ...]:
    """Uprights without those that are there already, nearest first. uprights: most probable first."""
    places = np.array([each.position for each in uprights]).reshape(-1, 2)
    ranges = np.hypot(*places.T)
    reach = np.maximum(_SAME * ranges, 0.5 * np.array([each.width for each in uprights]))
    kept = first_apart(np.hypot(*(places[:, None] - places).T) < reach[:, None])
    return tuple(uprights[number] for number in kept[np.argsort(ranges[kept], kind="stable")])


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
