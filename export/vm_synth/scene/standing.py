"""What stands on the ground of a scene and matters to a robot: goal posts, robots and people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Singles

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

    kind: post, robot or person. base: x and y of the middle of its foot [m]. width: horizontal, across the direction
    from the camera [m]. height: of its highest point above the plane [m].
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
            found += [_standing("post", foot, float(vertices[:, 2].max())) for foot in _post_feet(vertices)]
        elif label == "robot" or name in PEOPLE:
            top = float(vertices[:, 2].max())
            found.append(_standing("robot" if label == "robot" else "person", vertices, top))
    return found


def _post_feet(vertices: Singles) -> tuple[Singles, Singles]:
    """The vertices of a goal's left and right post on the ground."""
    ground = vertices[vertices[:, 2] < _GROUND]
    from_middle = ground[:, :2] - ground[:, :2].mean(axis=0)
    axis = from_middle[np.argmax((from_middle**2).sum(axis=1))]
    left = from_middle @ axis > 0.0
    return ground[left], ground[~left]


def _standing(kind: str, vertices: Singles, top: float) -> Standing:
    """The description of an object with these vertices (n, 3) [m], whose highest point is at the height `top` [m]."""
    foot = vertices[vertices[:, 2] <= _FOOT * top][:, :2]
    base = 0.5 * (foot.min(axis=0) + foot.max(axis=0)).astype(np.float64)
    across = np.array([-base[1], base[0]]) / max(float(np.hypot(*base)), 1e-9)
    width = float(np.ptp(vertices[:, :2] @ across))
    return Standing(kind, (float(base[0]), float(base[1])), width, top)
