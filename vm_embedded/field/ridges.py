"""Lines in the picture: a field line is a narrow bright ridge.

Rings of the mesh are far from each other beyond a few meters, so points alone say only roughly where a line is that
runs along a ring. The picture knows better: brightness across a piece, at places along it, shows the ridge. The piece
moves there. One without a ridge along most of it needs more points that speak for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Chosen, Floats, Singles
from .ground_points import GroundPoints
from .lines import Piece, tolerance
from .ridge_edges import Ridges

Profiles = Callable[[Floats, int], tuple[Singles, Floats]]
"""Brightness (n, count), 0 to 255, at evenly spaced places from one end to the other of each stretch (n, 2, 2) [m] on
the plane, NaN outside of the picture, and the pixels (n,) between two of these places."""

_STATIONS = 12
"""Profiles of a piece."""

_AT = (np.arange(_STATIONS) + 0.5) / _STATIONS
_SHARES = np.stack([1.0 - _AT, _AT], axis=1)
"""Shares (T, 2) of the two ends of a piece in the place of each profile."""

_HALF = 16
"""Samples of a profile on each side of the piece."""

_SAMPLES = 2 * _HALF + 1

_MARGIN = 0.12
"""How far profiles reach beyond the places where the ridge may be [m], to see what is beside it."""

_SHIFTS = 7
"""Places that are tried for each end of a piece."""

_TRIED = np.linspace(-1.0, 1.0, _SHIFTS)
"""These places, as shares of how far the ridge may be from the end."""

_BESIDE = np.array([[-1], [0], [1]])
"""A ridge may weave by a sample."""

_SUM = np.ones(_STATIONS, np.float32)
_MEAN = np.full(_STATIONS * _SAMPLES, 1.0 / (_STATIONS * _SAMPLES), np.float32)

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


def pieces_on_ridges(
    pieces: Sequence[Piece], points: GroundPoints, profiles: Profiles
) -> tuple[list[Piece], Ridges | None]:
    """The pieces that points and picture speak for, moved to their ridges, in the same order; and the ridges of all.

    points: of the frame; their spacing says how far a ridge may be. profiles: brightness of the frame.
    """
    if not pieces:
        return [], None
    ends = np.array([each.ends for each in pieces])  # (p, 2, 2)
    lengths = np.array([each.length for each in pieces])
    normals = (ends[:, 1] - ends[:, 0])[:, ::-1] * (-1.0, 1.0) / lengths[:, None]
    free = _free_reach(ends, normals, points)
    reach = free + _MARGIN
    aside = reach[:, :, None] * normals[:, None]
    corners = np.concatenate([ends - aside, ends + aside], axis=2)  # (p, 2, 4)
    brightness, pixels = profiles((_SHARES @ corners).reshape(-1, 2, 2), _SAMPLES)
    steps = reach.sum(axis=1) / (2 * _HALF)  # (p,) [m]
    middle = np.sort(pixels.reshape(-1, _STATIONS), axis=1)[:, _STATIONS // 2]
    widths = np.maximum(_WIDTH / steps, _BLUR / np.maximum(middle, 1e-6))
    contrasts = _contrasts(brightness.reshape(-1, _STATIONS, _SAMPLES), widths)
    shifts, near, beside = _best_shifts(contrasts, free, lengths)
    shown = beside.max(axis=1) > _CONTRAST
    shares = shown.sum(axis=1) / _STATIONS
    moved = ends + shifts[:, :, None] * normals[:, None]
    at = near[:, 1] + beside.argmax(axis=1) - 1
    spans = reach @ (_SHARES.T / _HALF)
    ridges = Ridges(brightness, at, shown, spans, pixels.reshape(-1, _STATIONS), ends, normals, lengths, _AT)
    kept = [
        replace(piece, ends=its_ends)
        for piece, its_ends, share in zip(pieces, moved, shares.tolist(), strict=True)
        if share + _SUPPORT_WORTH * min(piece.support, _MOST_SUPPORT) > _LEAST
    ]
    return kept, ridges


def _free_reach(ends: Floats, normals: Floats, points: GroundPoints) -> Floats:
    """How far (p, 2) [m] the ridge may be from both ends (p, 2, 2) of pieces: as far as points may be."""
    ranges = np.maximum(np.hypot(ends[:, :, 0], ends[:, :, 1]), 1e-3)
    outward = np.abs((ends * normals[:, None]).sum(axis=2)) / ranges
    return tolerance(outward, 0.5 * points.along(ranges), 0.5 * points.across)


def _windows(width: int) -> Singles:
    """Shares (N, 3 N) of all samples in the means of the left side, the ridge and the right side around each sample.

    They are 0 where a side is not in the profile. width: of the ridge, in samples.
    """
    half, at = width // 2, np.arange(_SAMPLES)
    off = at[:, None] - at
    sides = [
        (off <= -half - width) & (off > -half - 2 * width - 2),
        np.abs(off) <= half,
        (off >= half + width) & (off < half + 2 * width + 2),
    ]
    inside = np.abs(at - _HALF) <= _HALF - width - half
    shares = [inside * side / np.maximum(side.sum(axis=0), 1) for side in sides]
    return np.concatenate(shares, axis=1).astype(np.float32)


_WINDOWS = np.stack([_windows(width) for width in range(1, _HALF // 4 + 1)])


def _contrasts(brightness: Singles, widths: Floats) -> Singles:
    """Contrast (p, T, N) of a ridge at each sample of the profiles (p, T, N) to the brighter one of its sides.

    widths (p,): of the ridge, in samples. NaN, and a sample whose sides are not in the profile, has the contrast 0.
    """
    shown = brightness == brightness
    values = np.where(shown, brightness, np.float32(0.0))
    width = np.minimum(np.maximum(np.rint(widths), 1.0), len(_WINDOWS)).astype(np.intp)
    left, ridge, right = (values @ _WINDOWS[width - 1]).reshape(*values.shape[:2], 3, _SAMPLES).transpose(2, 0, 1, 3)
    contrasts = ridge - np.maximum(left, right)
    contrasts /= (values.reshape(len(values), -1) @ _MEAN + np.float32(_DARK))[:, None, None]
    contrasts *= shown
    return np.asarray(np.minimum(np.maximum(contrasts, _LIMITS[0]), _LIMITS[1]))


def _best_shifts(contrasts: Singles, free: Floats, lengths: Floats) -> tuple[Floats, Chosen, Singles]:
    """Shifts (p, 2) [m] of the ends of pieces that have the highest mean contrast, the positions (p, 3, T) of the
    samples there and beside, and their contrasts (p, 3, T).

    contrasts (p, T, N): see _contrasts. free (p, 2) [m]: how far the ridge may be from the ends. lengths (p,) [m]: of
    the pieces.
    """
    count = len(free)
    spans = (free + _MARGIN) @ (_SHARES.T / _HALF)  # (p, T): of a sample
    farthest = free.T[:, :, None] * _SHARES.T[:, None] / spans  # (2, p, T): in samples, for each end
    one, other = farthest[:, :, None] * _TRIED[:, None]  # (p, S, T)
    places = (one[:, :, None] + other[:, None] + (_HALF + 0.5)).astype(np.intp)  # (p, S, S, T)
    places += np.arange(0, contrasts.size, _SAMPLES).reshape(count, 1, 1, _STATIONS)
    totals = (contrasts.take(places).reshape(-1, _STATIONS) @ _SUM).reshape(-1, _SHIFTS, _SHIFTS)
    one, other = free.T[:, :, None] * _TRIED  # (p, S): [m]
    totals[np.abs(one[:, :, None] - other[:, None]) > (_TURN * lengths)[:, None, None]] = -np.inf
    best = totals.reshape(count, -1).argmax(axis=1)
    rows = np.arange(count)
    near = places.reshape(count, -1, _STATIONS)[rows, best][:, None] + _BESIDE  # (p, 3, T)
    beside = contrasts.take(near, mode="clip")  # the first and the last sample have the contrast 0
    return np.array([one[rows, best // _SHIFTS], other[rows, best % _SHIFTS]]).T, near, beside
