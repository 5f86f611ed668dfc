"""Whether a fitted candidate is an object: it must be filled, the band around it empty, and no other object there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats
from .candidates import Candidate
from .prepared_view import PreparedView
from .settings import Settings

_FARTHEST = 1e5
"""Distance, in camera heights, beyond which an object counts as on the horizon."""

_INSIDE_ENDS, _BAND_BEGINS, _BAND_ENDS = -0.25, 0.75, 2.25
"""Distances from the outline, in ring spacings: where the inside ends, and where the band around begins and ends."""


def judge(view: PreparedView, candidate: Candidate, accepted: Sequence[Candidate], settings: Settings) -> Candidate:
    """The candidate, with a reason if its points don't show an object at its center or an accepted one is there."""
    reason = _misfit(view, candidate, settings) or repeated(view, candidate.center, [each.center for each in accepted])
    return replace(candidate, reason=reason)


def _misfit(view: PreparedView, candidate: Candidate, settings: Settings) -> str | None:
    """Why the points do not look like an object at the center, or None.

    A zone one ring spacing wide around the outline is ignored, because pixels there show both sides. It reaches from a
    quarter of a spacing inside to three quarters outside, because a ring that grazes the object shows some of it. The
    band that must be empty is the next 1.5 spacings.

    Nearer to the nadir than one object's size, the mesh is singular (the paper's second limitation, section
    "Discussion and Conclusion"): ring6 has too few points there, and uneven links. An object may seem to cover twice
    its area, so the band begins and ends sqrt(2) times as far out.
    """
    center, p = candidate.center, candidate.probabilities
    if center[2] >= 0.0 or np.linalg.norm(center) > _FARTHEST * view.height:
        return "on the horizon or above it"
    offset = view.shape.offset(candidate.rays, center[None], view.height)[0]
    whole = math.pi / 4.0 * view.rings**2  # its bounding square has rings^2 points, and a disk fills pi / 4 of that
    visible = int((offset < 1.0).sum())
    if visible < settings.min_visible * whole:
        return f"{visible} of its points on screen, where a whole object has about {whole:.0f}"
    inside = p[offset < 1.0 + _INSIDE_ENDS * view.ring_spacing]
    if len(inside) == 0 or inside.mean() < settings.min_inside:
        share = inside.mean() if len(inside) else 0.0
        return f"mean probability inside its outline is {share:.2f}, below {settings.min_inside:g}"
    inclination = math.atan2(math.hypot(center[0], center[1]), -center[2])
    band_offset = offset / (math.sqrt(2.0) if view.shape.n(inclination, view.height) < 1.0 else 1.0)
    first, last = 1.0 + _BAND_BEGINS * view.ring_spacing, 1.0 + _BAND_ENDS * view.ring_spacing
    around = p[(band_offset > first) & (band_offset < last)]
    if len(around) and around.mean() > settings.max_around:
        return f"mean probability around its outline is {around.mean():.2f}, above {settings.max_around:g}"
    return None


def repeated(view: PreparedView, center: Floats, accepted: Sequence[Floats]) -> str | None:
    """Why an object with this center is an accepted one: the center is inside that one's outline. None if it is not.

    center (3,), and those of the accepted objects: relative to the camera in the mesh frame [m].
    """
    if not accepted:
        return None
    ray = (center / np.linalg.norm(center))[None]
    offset = view.shape.offset(ray, np.stack(accepted), view.height)[:, 0]
    nearest = int(np.argmin(offset))
    return f"the same object as the one at {np.linalg.norm(accepted[nearest]):.2f} m" if offset[nearest] < 1.0 else None
