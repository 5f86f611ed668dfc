"""The field of view: which part of the plane a frame shows."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Mask
from .prepared_view import PreparedView

REACH = 12.0
"""Distance on the plane at which the field of view is cut [m]."""

_AZIMUTHS, _STEPS, _HALVINGS = 360, 40, 8
"""Directions around the camera, steps from straight down to `REACH`, and halvings of the step at an edge."""


def field_of_view(view: PreparedView) -> list[Floats]:
    """Polygons (m, 2) [m] around the part of the plane on screen, in its frame, up to the distance REACH.

    Usually there is one. There are two, one inside the other, if the picture shows all around but not the foot point.
    For each direction, the nearest and the farthest visible place count: a gap between them is not shown.
    """
    azimuths = np.linspace(-np.pi, np.pi, _AZIMUTHS, endpoint=False)
    tilts = np.linspace(0.0, np.arctan2(REACH, view.height), _STEPS + 1)  # from straight down [rad]
    grid = [each.ravel() for each in np.meshgrid(azimuths, tilts, indexing="ij")]
    shown = _on_screen(view, *grid).reshape(_AZIMUTHS, _STEPS + 1)
    found = np.asarray(shown.any(axis=1))
    if not found.any():
        return []
    near, far = shown.argmax(axis=1), _STEPS - shown[:, ::-1].argmax(axis=1)
    inner = _edge(view, azimuths, tilts[near], tilts[np.maximum(near - 1, 0)])
    outer = _edge(view, azimuths, tilts[far], tilts[np.minimum(far + 1, _STEPS)])
    rings = [_places(view, azimuths, each) for each in (outer, inner)]
    if found.all():
        return [rings[0]] if shown[:, 0].all() else rings
    # Begin each run of directions behind one that shows nothing.
    order = np.roll(np.arange(_AZIMUTHS), -int(np.flatnonzero(~found)[0]))
    runs = np.split(order, np.flatnonzero(np.diff(found[order])) + 1)
    return [np.concatenate([rings[0][each], rings[1][each[::-1]]]) for each in runs if found[each[0]]]


def _rays(azimuths: Floats, tilts: Floats) -> Floats:
    """Unit vectors (n, 3) in the mesh frame. azimuths: from straight ahead. tilts: from straight down [rad]."""
    sine = np.sin(tilts)
    return np.column_stack([sine * np.cos(azimuths), sine * np.sin(azimuths), -np.cos(tilts)])


def _on_screen(view: PreparedView, azimuths: Floats, tilts: Floats) -> Mask:
    """Whether the picture shows these directions (n,)."""
    return view.in_picture(view.ray_pixels(_rays(azimuths, tilts)))


def _edge(view: PreparedView, azimuths: Floats, shown: Floats, hidden: Floats) -> Floats:
    """Tilts (n,) at the edge of the picture, between tilts that it shows and that it does not."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (shown + hidden)
        seen = _on_screen(view, azimuths, middle)
        shown, hidden = np.where(seen, middle, shown), np.where(seen, hidden, middle)
    return shown


def _places(view: PreparedView, azimuths: Floats, tilts: Floats) -> Floats:
    """Where rays meet the plane (n, 2) [m], in its frame."""
    rays = _rays(azimuths, tilts)
    return np.asarray((view.height * rays / -rays[:, 2:] @ view.heading.T)[:, :2])
