"""From an observation to objects on the plane: propose, fit, judge, describe."""

from __future__ import annotations

import math

import cv2
import numpy as np

from ..arrays import Floats
from .candidates import Candidate, propose
from .detections import Detection
from .fitting import best_scale, fit
from .judging import judge
from .observation import Observation
from .settings import Settings


def locate(
    observation: Observation, settings: Settings, explain: bool = False
) -> tuple[tuple[Detection, ...], tuple[Detection, ...]]:
    """The objects that an observation shows, most confident first, and, with `explain`, the rejected candidates.

    It looks only for classes of the kind "object".
    """
    view = observation.view
    found: list[Candidate] = []
    rejected: list[Candidate] = []
    for object_class, probabilities in zip(observation.manifest.classes, observation.slot_probabilities.T, strict=True):
        if object_class.kind != "object":
            continue
        accepted: list[Candidate] = []
        for candidate in propose(observation, object_class.name, probabilities, settings):
            if candidate.reason is None:
                candidate = judge(view, fit(view, candidate), accepted, settings)
            if candidate.reason is None:
                accepted.append(candidate)
            else:
                rejected.append(candidate)
        found += accepted
    objects = [_describe(observation, each) for each in found]
    reasons = [_describe(observation, each) for each in rejected] if explain else []
    return tuple(sorted(objects, key=lambda each: -each.confidence)), tuple(reasons)


def _describe(observation: Observation, candidate: Candidate) -> Detection:
    """The candidate as a detection, in the frame's own observation plane."""
    view, center = observation.view, candidate.center
    offset = view.shape.offset(view.layout.rays[candidate.near], center[None], view.height)[0]
    inside = candidate.probabilities[offset < 1.0]
    distance = float(np.linalg.norm(center))
    scale = best_scale(view, candidate, offset)
    outline = view.pixels(view.shape.outline(center, view.height))
    # An object at the edge of the lens's view may have no outline in it.
    middle, radius = _disk(outline if len(outline) > 2 else observation.projected.pixels[candidate.near])
    return Detection(
        class_name=candidate.class_name,
        confidence=float(inside.mean()) if len(inside) else 0.0,
        center=middle,
        radius=radius,
        outline=outline,
        bearing=view.heading @ center / distance,
        position=view.heading @ center + (0.0, 0.0, view.height),
        distance=distance,
        angular_radius=math.asin(min(scale * view.shape.radius / distance, 1.0)),
        distance_by_angle=distance / scale,
        distances_agree=abs(scale - 1.0) <= view.spacing,
        points=len(inside),
        reason=candidate.reason,
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
