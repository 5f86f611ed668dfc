"""What stands on the ground of a scene and matters to a robot: goal posts, robots and people."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles

from ..bodies.catalog import PEOPLE
from ..bodies.solids import LABELS
from .scene import Scene

_FOOT = 0.2
"""Share of a body's height that counts as its foot."""

_GROUND = 0.01
"""The lower ends of goal posts are below this height [m]."""


@dataclass(frozen=True)
class Standing:
    """A goal post, robot or person in the world frame.

    kind: post, robot or person. base: x and y [m] of the middle of a post's foot; of a robot or person, the point where
    its foot begins in the direction of its middle. width: horizontal, across the direction from the camera [m]. height:
    of its highest point above the plane [m].
    """

    kind: str
    base: tuple[float, float]
    width: float
    height: float


def standing_objects(scene: Scene) -> list[Standing]:
    """All goal posts, robots and people of a scene, also those that are hidden or outside of the picture.

    The carrier of the camera is not among them.
    """
    mesh = scene.mesh
    label_of = np.zeros(len(mesh.vertices), dtype=np.int32)
    label_of[mesh.triangles[:, 0]] = mesh.labels
    found = []
    for name, end, count in zip(scene.names, np.cumsum(scene.counts), scene.counts, strict=True):
        part = slice(end - count, end)
        vertices = mesh.vertices[part]
        label = LABELS[label_of[part].max(initial=0)]
        if label == "goal":
            top = float(vertices[:, 2].max())
            found += [_standing("post", foot, _middle(foot), top) for foot in _post_feet(vertices)]
        elif label == "robot" or name in PEOPLE:
            top = float(vertices[:, 2].max())
            foot = vertices[vertices[:, 2] <= _FOOT * top]
            found.append(_standing("robot" if label == "robot" else "person", vertices, _front(foot), top))
    return found


def _post_feet(vertices: Singles) -> tuple[Singles, Singles]:
    """The vertices of a goal's left and right post on the ground."""
    ground = vertices[vertices[:, 2] < _GROUND]
    from_middle = ground[:, :2] - ground[:, :2].mean(axis=0)
    axis = from_middle[np.argmax((from_middle**2).sum(axis=1))]
    left = from_middle @ axis > 0.0
    return ground[left], ground[~left]


def _standing(kind: str, vertices: Singles, base: Floats, top: float) -> Standing:
    """The description of an object with these vertices (n, 3), this base (2,) [m] and a highest point at `top` [m]."""
    across = np.array([-base[1], base[0]]) / max(float(np.hypot(*base)), 1e-9)
    width = float(np.ptp(vertices[:, :2] @ across))
    return Standing(kind, (float(base[0]), float(base[1])), width, top)


def _middle(foot: Singles) -> Floats:
    """The middle (2,) [m] of a foot (n, 3) [m]."""
    return np.asarray(0.5 * (foot[:, :2].min(axis=0) + foot[:, :2].max(axis=0)), dtype=np.float64)


def _front(foot: Singles) -> Floats:
    """The point (2,) [m] where the convex hull of a foot (n, 3) [m] begins, seen from the camera toward its middle."""
    hull = cv2.convexHull(np.ascontiguousarray(foot[:, :2], dtype=np.float32))[:, 0].astype(np.float64)
    heading = math.atan2(*hull.mean(axis=0)[::-1])
    beside = (np.arctan2(hull[:, 1], hull[:, 0]) - heading + math.pi) % (2.0 * math.pi) - math.pi
    heading += 0.5 * float(beside.min() + beside.max())
    ahead = np.array([math.cos(heading), math.sin(heading)])
    along, across = hull @ ahead, hull @ np.array([-ahead[1], ahead[0]])
    following = np.roll(across, -1)
    crossing = np.flatnonzero((across < 0.0) != (following < 0.0))  # edges of the hull that the ray meets
    share = across[crossing] / (across[crossing] - following[crossing])
    meets = along[crossing] + share * (np.roll(along, -1)[crossing] - along[crossing])
    return np.asarray(max(float(meets.min(initial=along.max())), 0.0) * ahead)
