"""From the points of a class to objects on the plane, by the paper's two suggestions.

An object leaves a known trace in the mesh: the subgraph inside its outline, as wide as its intersections. So a cluster
that is much wider (its graph diameter) is no object, and for every other one the object is sought whose subgraph fits
best; it must be filled, and the band around it empty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..arrays import Floats, Indices, Mask, Singles
from ..geometry.lens import Lens, Size
from ..geometry.shape import Shape, tangents
from ..mesh.mesh import PointGraph
from ..network.manifest import ObjectClass
from .clustering import Members, clusters, wider_than
from .detections import Detection
from .projection import Projection, along, to_camera
from .settings import Settings

_MOST_CLUSTERS = 100
"""Clusters that are looked at, largest first: a frame of noise must not cost a second."""

_CERTAIN = 4.0
"""Log-odds beyond which a point counts no more: one point must not outvote its neighbors."""

_GRID = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 5)), axis=2).reshape(-1, 2)
"""Where the search for a center looks, in units of its reach."""

_REACHES = (1.0, 0.3, 0.1)
"""Reach of each round of the search, in object radii; upwards and downwards in half heights of what is taller."""

_SCALES = np.geomspace(0.6, 1.8, 15)
"""Apparent sizes that are tried, as shares of the expected one."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Where objects are sought.

    shape: of the object. height: of the camera [m]. rotation (3, 3): camera to mesh frame, in which the search works.
    heading (3, 3): mesh frame to the observation plane, in which its answers are. lens and image size. projected: the
    mesh; only what is on screen counts. order: rank of each point; in this order they are summed, so that digits don't
    depend on how the mesh lies in memory. rings: number of mesh rings that cross an object here.
    """

    shape: Shape
    height: float
    rotation: Floats
    heading: Floats
    lens: Lens
    size: Size
    projected: Projection[PointGraph]
    order: Indices
    rings: float

    @property
    def spacing(self) -> float:
        """Distance between rings, in units of the outline that `Shape.offset` counts in."""
        return 2.0 / self.rings

    def sorted(self, chosen: Mask) -> Members:
        """The chosen points (n,) that are on screen."""
        members = np.flatnonzero(chosen & self.projected.on_screen)
        return members[np.argsort(self.order[members])]

    def pixels(self, rays: Floats) -> Floats:
        """Pixels (m, 2) of those of the rays (n, 3) that the lens sees, on screen or not."""
        camera = to_camera(rays, self.rotation)
        return self.lens.project(camera[self.lens.sees(camera)], self.size)


def find_objects(
    scene: Scene, classes: Sequence[ObjectClass], probabilities: Singles, settings: Settings, explain: bool = False
) -> tuple[tuple[Detection, ...], tuple[Detection, ...]]:
    """The objects that the points' probabilities (n, C) show, most confident first, and the rejected clusters.

    Only classes of the kind "object" are looked for, and only with `explain` are the rejected ones described.
    """
    found: list[Detection] = []
    rejected: list[Detection] = []
    for each, probability in zip(classes, probabilities.T, strict=True):
        if each.kind == "object":
            _find(scene, each.name, probability, settings, found, rejected if explain else None)
    return tuple(sorted(found, key=lambda each: -each.confidence)), tuple(rejected)


def _find(
    scene: Scene,
    class_name: str,
    p: Singles,
    settings: Settings,
    found: list[Detection],
    rejected: list[Detection] | None,
) -> None:
    """Add the objects of one class, from its probabilities (n,), to `found` and all else to `rejected`."""
    members = scene.sorted(p > settings.threshold)
    if len(members) == 0:
        return
    centers: list[Floats] = []
    for cluster in clusters(scene.projected.graph, members)[:_MOST_CLUSTERS]:
        center = _middle(scene, cluster)
        near = _near(scene, cluster, center)
        p_near = p[near].astype(np.float64)
        log_odds = np.log(np.maximum(p_near, 1e-12) / np.maximum(1.0 - p_near, 1e-12)).clip(-_CERTAIN, _CERTAIN)
        reason = _wrong_size(scene, cluster, center, near, settings)
        if reason is None:
            center = _best_center(scene, center, near, log_odds)
            reason = _misfit(scene, center, near, p_near, settings) or _repeats(scene, center, centers)
        if reason is None:
            centers.append(center)
            found.append(_describe(scene, class_name, center, near, p_near, log_odds, None))
        elif rejected is not None:
            rejected.append(_describe(scene, class_name, center, near, p_near, log_odds, reason))


def _middle(scene: Scene, members: Members) -> Floats:
    """Center (3,) [m] of an object in the direction of a cluster's mean ray."""
    axis = scene.projected.graph.rays[members].mean(axis=0, keepdims=True)
    return np.asarray(scene.shape.center_along(axis / np.linalg.norm(axis), scene.height)[0])


def _near(scene: Scene, members: Members, center: Floats) -> Members:
    """The points of a cluster in the direction of `center`, and those up to three object radii around it."""
    rays = scene.projected.graph.rays
    distance = float(np.linalg.norm(center))
    axis = center / distance
    cosines = along(rays, axis)
    chord = math.sqrt(2.0 * max(1.0 - float(cosines[members].min()), 0.0)) + 3.0 * scene.shape.radius / distance
    return scene.sorted(cosines > 1.0 - 0.5 * min(chord, 2.0) ** 2)


def _wrong_size(scene: Scene, members: Members, center: Floats, near: Members, settings: Settings) -> str | None:
    """Why a cluster around `center` can't be an object, by its number of points and its width alone, or None."""
    expected = int((scene.shape.offset(scene.projected.graph.rays[near], center[None], scene.height) < 1.0).sum())
    # A filled object has more than half of its points in its cluster; half of that allows for a center that is off.
    if len(members) < 0.25 * expected:
        return f"{len(members)} points, where an object there has {expected}"
    widest = math.ceil(settings.max_widths * scene.rings)
    middle = int(np.argmax(scene.projected.graph.rays[members] @ center))
    if wider_than(scene.projected.graph, members, middle, widest):
        return f"wider than {widest} steps in the mesh, where an object is {scene.rings:.1f} wide"
    return None


def _best_center(scene: Scene, center: Floats, near: Members, log_odds: Floats) -> Floats:
    """Center (3,) [m] of the object whose subgraph fits best around `center`.

    The likeliest object has the largest sum of log-odds inside its outline: the best of a grid of places, then of ever
    finer ones around it. The outline is half a ring spacing soft, so that the sum has no plateaus between points. What
    is off screen adds nothing, so an object that the border cuts gets its center where it belongs.
    """
    rays = np.ascontiguousarray(scene.projected.graph.rays[near])
    for reach in _REACHES:
        distance = float(np.linalg.norm(center))
        axis = center / distance
        across, up = scene.shape.radius, max(scene.shape.radius, scene.shape.center_height)
        tried = axis + reach / distance * ((_GRID * (across, up)) @ tangents(axis))
        centers = scene.shape.center_along(tried, scene.height)
        center = centers[int(np.argmax(_soft(scene.shape.offset(rays, centers, scene.height), scene) @ log_odds))]
    return center


def _soft(offset: Floats, scene: Scene) -> Floats:
    """How far points are inside of the outline: 1 inside, 0 outside, over half a ring spacing."""
    return np.clip(0.5 + (1.0 - offset) / (0.5 * scene.spacing), 0.0, 1.0)


def _misfit(scene: Scene, center: Floats, near: Members, p: Floats, settings: Settings) -> str | None:
    """Why the points do not look like an object at `center`, or None.

    Points within a ring spacing of the outline say little: their pixels show both sides, and networks color them
    either way, rather outwards, because a ring that grazes the object shows some of it. So the inside ends a quarter
    of a spacing before the outline, the band around begins three quarters beyond it, and is 1.5 spacings wide.

    Less than one object from the nadir the mesh is singular and up to twice as many points see an object (the paper's
    second limitation): what looks like it may cover twice the area there, so the band is farther out by sqrt(2).
    """
    if center[2] >= 0.0 or np.linalg.norm(center) > 1e5 * scene.height:
        return "on the horizon or above it"
    offset = scene.shape.offset(scene.projected.graph.rays[near], center[None], scene.height)[0]
    whole = math.pi / 4.0 * scene.rings**2
    visible = int((offset < 1.0).sum())
    if visible < settings.min_visible * whole:
        return f"{visible} points of it on screen, where a whole object has about {whole:.0f}"
    inside = p[offset < 1.0 - 0.25 * scene.spacing]
    if len(inside) == 0 or inside.mean() < settings.min_inside:
        share = inside.mean() if len(inside) else 0.0
        return f"mean probability inside its outline is {share:.2f}, below {settings.min_inside:g}"
    inclination = math.atan2(math.hypot(center[0], center[1]), -center[2])
    apparent = offset / (math.sqrt(2.0) if scene.shape.n(inclination, scene.height) < 1.0 else 1.0)
    around = p[(apparent > 1.0 + 0.75 * scene.spacing) & (apparent < 1.0 + 2.25 * scene.spacing)]
    if len(around) and around.mean() > settings.max_around:
        return f"mean probability around its outline is {around.mean():.2f}, above {settings.max_around:g}"
    return None


def _repeats(scene: Scene, center: Floats, others: list[Floats]) -> str | None:
    """Why an object at `center` is one of the others, whose center it covers, or None."""
    ray = (center / np.linalg.norm(center))[None]
    for other in others:
        if scene.shape.offset(ray, other[None], scene.height)[0, 0] < 1.0:
            return f"the same object as the one at {np.linalg.norm(other):.2f} m"
    return None


def _describe(
    scene: Scene, class_name: str, center: Floats, near: Members, p: Floats, log_odds: Floats, reason: str | None
) -> Detection:
    offset = scene.shape.offset(scene.projected.graph.rays[near], center[None], scene.height)[0]
    inside = p[offset < 1.0]
    distance = float(np.linalg.norm(center))
    # The size that fits best at this bearing, not knowing how far away the plane puts it.
    sums = _soft(offset / _SCALES[:, None], scene) @ log_odds
    scale = float(_SCALES[int(np.argmax(sums))])
    outline = scene.pixels(scene.shape.outline(center, scene.height))
    # An object at the edge of the lens's view may have no outline in it.
    middle, radius = _disk(outline if len(outline) > 2 else scene.projected.pixels[near])
    return Detection(
        class_name=class_name,
        confidence=float(inside.mean()) if len(inside) else 0.0,
        center=middle,
        radius=radius,
        outline=outline,
        bearing=scene.heading @ center / distance,
        position=scene.heading @ center + (0.0, 0.0, scene.height),
        distance=distance,
        angular_radius=math.asin(min(scale * scene.shape.radius / distance, 1.0)),
        distance_by_angle=distance / scale,
        distances_agree=abs(scale - 1.0) <= scene.spacing,
        points=len(inside),
        reason=reason,
    )


def _disk(outline: Floats) -> tuple[Floats, float]:
    """Centroid (2,) and equal-area radius [px] of a polygon (m, 2)."""
    origin = outline.mean(axis=0)
    moments = cv2.moments((outline - origin).astype(np.float32))
    area = moments["m00"]
    if area < 1e-9:
        return origin, 0.0
    shift = np.array([moments["m10"], moments["m01"]]) / area
    return origin + shift, math.sqrt(area / math.pi)
