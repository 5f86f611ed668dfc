"""Lines in the picture: a field line is a narrow bright ridge.

Rings of the mesh are far from each other beyond a few meters, so points alone say only roughly where a line is that
runs along a ring. The picture knows better: brightness across a piece, at places along it, shows the ridge. The piece
moves there. One without a ridge along most of it needs more points that speak for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles
from .ground_points import GroundPoints
from .lines import Piece, tolerance

Profiles = Callable[[Floats, int], tuple[Singles, Floats]]
"""Brightness (n, count), 0 to 255, at evenly spaced places from one end to the other of each stretch (n, 2, 2) [m] on
the plane, NaN outside of the picture, and the pixels (n,) between two of these places."""

_STATIONS = 12
"""Profiles of a piece."""

_HALF = 20
"""Samples of a profile on each side of the piece."""

_MARGIN = 0.12
"""How far profiles reach beyond the places where the ridge may be [m], to see what is beside it."""

_SHIFTS = 7
"""Places that are tried for each end of a piece."""

_TURN = 0.06
"""A piece turns by at most this much [rad]."""

_WIDTH = 0.045
"""Width of the narrowest line [m]."""

_BLUR = 1.3
"""Width of the narrowest ridge in a picture [px]."""

_DARK = 8.0
"""Brightness that is added to that of the surroundings: contrast in dark pictures is noise."""

_LIMITS = (-0.3, 0.6)
"""Contrasts outside of these limits count as the limits: a station at a reflection is one of many."""

_CONTRAST = 0.04
"""Contrast of a ridge, at least."""

_LEAST = 0.6
"""A piece is reported if its share of stations with a ridge and its support add up to more than this."""

_SUPPORT_WORTH = 0.07
"""Share of stations that a unit of support is worth."""

_MOST_SUPPORT = 6.0
"""More support does not count."""


def pieces_on_ridges(pieces: Sequence[Piece], points: GroundPoints, profiles: Profiles) -> list[Piece]:
    """The pieces that points and picture speak for, moved to their ridges, in the same order.

    points: of the frame; their spacing says how far a ridge may be. profiles: brightness of the frame.
    """
    if not pieces:
        return []
    ends = np.stack([each.ends for each in pieces])  # (p, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(along[:, 0], along[:, 1])
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / lengths[:, None]
    free = _free_reach(ends, normals, points)
    reach = free + _MARGIN
    at = (np.arange(_STATIONS) + 0.5) / _STATIONS
    weights = np.stack([1.0 - at, at])  # (2, T): of the two ends
    middles = np.einsum("et,pex->ptx", weights, ends)
    spans = reach @ weights  # (p, T): half the lengths of the profiles
    aside = spans[:, :, None] * normals[:, None]  # (p, T, 2)
    stretches = np.stack([middles - aside, middles + aside], axis=2).reshape(-1, 2, 2)
    brightness, pixels = profiles(stretches, 2 * _HALF + 1)
    steps = spans.mean(axis=1) / _HALF  # (p,) [m]
    widths = np.maximum(_WIDTH / steps, _BLUR / np.maximum(np.median(pixels.reshape(-1, _STATIONS), axis=1), 1e-6))
    contrasts = _contrasts(brightness.reshape(len(pieces), _STATIONS, -1), widths)
    shifts, shares = _best_shifts(contrasts, free, spans, weights, lengths)
    return [
        replace(piece, ends=piece.ends + np.outer(shift, normal))
        for piece, shift, normal, share in zip(pieces, shifts, normals, shares, strict=True)
        if share + _SUPPORT_WORTH * min(piece.support, _MOST_SUPPORT) > _LEAST
    ]


def _free_reach(ends: Floats, normals: Floats, points: GroundPoints) -> Floats:
    """How far (p, 2) [m] the ridge may be from both ends (p, 2, 2) of pieces: as far as points may be."""
    ranges = np.maximum(np.hypot(ends[:, :, 0], ends[:, :, 1]), 1e-3)
    outward = np.abs((ends * normals[:, None]).sum(axis=2)) / ranges
    return tolerance(outward, 0.5 * points.along(ranges), 0.5 * points.across)


def _contrasts(brightness: Singles, widths: Floats) -> Floats:
    """Contrast (p, T, N) of a ridge at each sample of the profiles (p, T, N) to the brighter one of its sides.

    widths (p,): of the ridge, in samples. NaN, and a sample whose sides are not in the profile, has the contrast 0.
    """
    count = brightness.shape[2]
    width = np.clip(np.rint(widths), 1, _HALF // 4).astype(np.intp)[:, None]
    half = width // 2
    known = np.nan_to_num(brightness).astype(np.float64)
    sums = np.pad(np.cumsum(known, axis=2), ((0, 0), (0, 0), (1, 0)))
    samples = np.arange(count)

    def means(low: Chosen, high: Chosen) -> Floats:
        """Means of the samples from `low` to `high` (p, 1), both included, around each sample."""
        first, last = (np.clip(samples + each, 0, count) for each in (low, high + 1))
        parts = [np.take_along_axis(sums, each[:, None], axis=2) for each in (first, last)]
        return np.asarray((parts[1] - parts[0]) / np.maximum(last - first, 1)[:, None])

    left, right = means(-half - 2 * width - 1, -half - width), means(half + width, half + 2 * width + 1)
    ridge = means(-half, half) - np.maximum(left, right)
    inside = (samples >= width + half) & (samples < count - width - half)
    seen: Mask = ~np.isnan(brightness) & inside[:, None]
    surroundings = known.mean(axis=(1, 2)) + _DARK
    return np.where(seen, np.clip(ridge / surroundings[:, None, None], *_LIMITS), 0.0)


def _best_shifts(
    contrasts: Floats, free: Floats, spans: Floats, weights: Floats, lengths: Floats
) -> tuple[Floats, Floats]:
    """Shifts (p, 2) [m] of the ends of pieces that have the highest mean contrast, and the share of stations (p,) with
    a ridge there.

    contrasts (p, T, N): see _contrasts. free (p, 2) [m]: how far the ridge may be from the ends. spans (p, T) [m]: half
    the lengths of the profiles. weights (2, T): of the ends at each station. lengths (p,) [m]: of the pieces.
    """
    tried = np.linspace(-1.0, 1.0, _SHIFTS)
    pairs = np.stack(np.meshgrid(tried, tried, indexing="ij"), axis=-1).reshape(-1, 2)  # (S, 2)
    shifts = pairs * free[:, None]  # (p, S, 2)
    offsets = (shifts @ weights) / spans[:, None]  # (p, S, T)
    samples = np.rint(offsets * _HALF).astype(np.intp) + _HALF
    rows = np.arange(len(contrasts))
    means = contrasts[rows[:, None, None], np.arange(_STATIONS), samples].mean(axis=2)
    means[np.abs(shifts[:, :, 1] - shifts[:, :, 0]) > _TURN * lengths[:, None]] = -1.0
    best = np.argmax(means, axis=1)
    near = samples[rows, best][:, :, None] + np.arange(-1, 2)  # the ridge may weave by a sample
    shown = np.take_along_axis(contrasts, np.clip(near, 0, 2 * _HALF), axis=2).max(axis=2)
    return shifts[rows, best], (shown > _CONTRAST).mean(axis=1)
