"""From an observation to objects on the plane.

The peaks of a class are its objects, after a close look if there is one (`looking.py`). Without peaks, clusters of
likely points are candidates, and their points decide: propose (`candidates.py`), fit, judge (`judging.py`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from ..arrays import Floats, Singles
from ..geometry.shape import tangents
from .candidates import Candidate, propose
from .detection import Detection
from .judging import judge
from .looking import Judged, Judgment
from .observation import Observation, Stopwatch
from .prepared_view import PreparedView
from .projection import along
from .settings import Settings

_SAME_SIZE = 0.2
"""With peaks, a Detection's `distance` and `distance_by_angle` agree if its apparent size differs from the
expected one by at most this share."""


def locate(
    observation: Observation, judged: Judged, settings: Settings, watch: Stopwatch, explain: bool = False
) -> tuple[tuple[Detection, ...], tuple[Detection, ...]]:
    """The objects that an observation shows, most confident first, and, with `explain`, the rejected candidates.

    It searches only for classes of the kind "object". judged: what is at the peaks. watch: gets the stage cluster.
    """
    objects: list[Detection] = []
    rejected: list[Detection] = []
    for object_class, probabilities in zip(observation.manifest.classes, observation.probabilities.T, strict=True):
        name = object_class.name
        if object_class.kind != "object":
            continue
        if name in judged:
            found = [_describe_judgment(observation, name, each) for each in judged[name][1]]
        else:
            candidates = _candidates(observation, name, probabilities, settings)
            found = [_describe_candidate(observation, each) for each in candidates if explain or each.reason is None]
        objects += [each for each in found if each.reason is None]
        rejected += [each for each in found if each.reason is not None]
    watch.lap("cluster")
    return tuple(sorted(objects, key=lambda each: -each.confidence)), tuple(rejected)


def _candidates(
    observation: Observation, class_name: str, probabilities: Singles, settings: Settings
) -> list[Candidate]:
    """The candidates of a class without peaks; those that are not objects have a reason."""
    view = observation.view
    accepted: list[Candidate] = []
    rejected: list[Candidate] = []
    for candidate in propose(observation, class_name, probabilities, settings):
        if candidate.reason is None:
            candidate = judge(view, fit(view, candidate), accepted, settings)
        (accepted if candidate.reason is None else rejected).append(candidate)
    return accepted + rejected


def _describe_candidate(observation: Observation, candidate: Candidate) -> Detection:
    """The candidate as a detection: its confidence is the mean probability of the points inside its outline."""
    view = observation.view
    offset = view.shape.offset(candidate.rays, candidate.center[None], view.height)[0]
    inside = candidate.probabilities[offset < 1.0]
    scale = best_scale(view, candidate, offset)
    return _detection(
        observation,
        candidate.class_name,
        candidate.center,
        confidence=float(inside.mean()) if len(inside) else 0.0,
        scale=scale,
        # The outline that fits best is at most one ring spacing larger or smaller. Both sides are in expected radii.
        distances_agree=abs(scale - 1.0) <= view.ring_spacing,
        points=len(inside),
        reason=candidate.reason,
    )


def _describe_judgment(observation: Observation, class_name: str, judgment: Judgment) -> Detection:
    """A peak or what a close look saw there, as a detection."""
    view = observation.view
    covered = view.shape.covers(observation.mesh_rays, judgment.center[None], view.height)[0]
    return _detection(
        observation,
        class_name,
        judgment.center,
        confidence=judgment.confidence,
        scale=judgment.scale,
        distances_agree=abs(judgment.scale - 1.0) <= _SAME_SIZE,
        points=int(np.count_nonzero(covered)),
        reason=judgment.reason,
    )


def _detection(
    observation: Observation,
    class_name: str,
    center: Floats,
    *,
    confidence: float,
    scale: float,
    distances_agree: bool,
    points: int,
    reason: str | None,
) -> Detection:
    """A detection in the plane's frame.

    center (3,) [m]: relative to the camera in the mesh frame. scale: apparent size as a share of the expected one. If
    the lens sees no outline, the detection's center is the pixel of the nearest point on screen, and its radius is 0.
    """
    view = observation.view
    distance = float(np.linalg.norm(center))
    outline = view.outline(center)
    if len(outline) > 2:
        middle, radius = _disk(outline)
    else:
        middle, radius = _nearest_pixel(observation, center / distance), 0.0
    return Detection(
        class_name=class_name,
        confidence=confidence,
        center=middle,
        radius=radius,
        outline=outline,
        bearing=view.heading @ center / distance,
        position=view.heading @ center + (0.0, 0.0, view.height),
        distance=distance,
        angular_radius=math.asin(min(scale * view.shape.radius / distance, 1.0)),
        distance_by_angle=distance / scale,
        distances_agree=distances_agree,
        points=points,
        reason=reason,
    )


def _nearest_pixel(observation: Observation, direction: Floats) -> Floats:
    """The pixel (2,) of the point on screen that is nearest to a direction (3,) in the mesh frame."""
    return np.asarray(observation.pixels[int(np.argmax(along(observation.mesh_rays, direction)))])


def _disk(outline: Floats) -> tuple[Floats, float]:
    """Centroid (2,) and equal-area radius [px] of a polygon (m, 2)."""
    origin = outline.mean(axis=0)
    moments = cv2.moments((outline - origin).astype(np.float32))
    area = moments["m00"]
    if area < 1e-9:
        return origin, 0.0
    shift = np.array([moments["m10"], moments["m01"]]) / area
    return origin + shift, math.sqrt(area / math.pi)


_GRID = np.stack(np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 5)), axis=2).reshape(-1, 2)
"""Places of one round of the search for a center, in units of the round's reach."""

_REACHES = (1.0, 0.3, 0.1)
"""Reach of each round, in object radii; along the vertical in half heights if the object is taller than wide."""

_SCALES = np.geomspace(0.6, 1.8, 15)
"""Apparent sizes to try, as shares of the expected one."""


def fit(view: PreparedView, candidate: Candidate) -> Candidate:
    """The candidate with the center [m] of the object whose subgraph fits best.

    If points were independent, the likeliest object would have the largest sum of log-odds inside its outline. The
    search takes the best of a grid of places, then of finer grids around it. Points near the outline count
    in part, so the sum changes smoothly with the center. Points off screen add nothing, so an object that the border
    cuts gets its true center.
    """
    center = candidate.center
    rays = np.ascontiguousarray(candidate.rays)
    for reach in _REACHES:
        distance = float(np.linalg.norm(center))
        axis = center / distance
        across, up = view.shape.radius, view.shape.half_size
        tried = axis + reach / distance * ((_GRID * (across, up)) @ tangents(axis))
        centers = view.shape.center_along(tried, view.height)  # which takes rays of any length
        inside = _share_inside(view.shape.offset(rays, centers, view.height), view)
        center = centers[int(np.argmax(inside @ candidate.log_odds))]
    return replace(candidate, center=center)


def best_scale(view: PreparedView, candidate: Candidate, offset: Floats) -> float:
    """The apparent size that fits best at the candidate's bearing, as a share of the one that the plane predicts.

    The paper identifies objects by their scale (fig:ball_detection_images_3). This function rejects
    nothing: detections only report the scale, as `angular_radius`, `distance_by_angle` and `distances_agree`.

    offset (p,): of the candidate's points from its center, as `Shape.offset` gives it.
    """
    sums = _share_inside(offset / _SCALES[:, None], view) @ candidate.log_odds
    return float(_SCALES[int(np.argmax(sums))])


def _share_inside(offset: Floats, view: PreparedView) -> Floats:
    """1 for points inside the outline, 0 outside.

    It falls from a quarter of a ring spacing inside of the outline to a quarter outside. offset: from the center, 1 on
    the outline, as `Shape.offset` gives it, or 1 on another outline that is tried. The ring spacing is that of the
    expected size.
    """
    return np.clip(0.5 + (1.0 - offset) / (0.5 * view.ring_spacing), 0.0, 1.0)
