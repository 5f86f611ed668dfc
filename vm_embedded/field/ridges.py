"""Lines in the picture: a field line is a narrow bright ridge.

Rings of the mesh are far from each other beyond a few meters, so points alone say only roughly where a line is that
runs along a ring. The picture knows better: brightness across a piece, at places along it, shows the ridge. The piece
moves there. One without a ridge along most of it needs more points that speak for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats, Singles
from .ground_points import GroundPoints
from .lines import Piece, tolerance

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

_MARGIN = 0.12
"""How far profiles reach beyond the places where the ridge may be [m], to see what is beside it."""

_SHIFTS = 7
"""Places that are tried for each end of a piece."""

_TRIED = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, _SHIFTS)], indexing="ij"), axis=-1).reshape(-1, 2)
"""Pairs (S, 2) of these places, as shares of how far the ridge may be from the ends."""

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
    ends = np.array([each.ends for each in pieces])  # (p, 2, 2)
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(along[:, 0], along[:, 1])
    normals = along[:, ::-1] * (-1.0, 1.0) / lengths[:, None]
    free = _free_reach(ends, normals, points)
    reach = free + _MARGIN
    aside = reach[:, :, None] * normals[:, None]
    corners = np.concatenate([ends - aside, ends + aside], axis=2)  # (p, 2, 4)
    brightness, pixels = profiles((_SHARES @ corners).reshape(-1, 2, 2), 2 * _HALF + 1)
    steps = reach.sum(axis=1) / (2 * _HALF)  # (p,) [m]
    middle = np.sort(pixels.reshape(-1, _STATIONS), axis=1)[:, _STATIONS // 2]
    contrasts = _contrasts(
        brightness.reshape(-1, _STATIONS, 2 * _HALF + 1).transpose(0, 2, 1),
        np.maximum(_WIDTH / steps, _BLUR / np.maximum(middle, 1e-6)),
    )
    shifts, shares = _best_shifts(contrasts, free, lengths)
    return [
        replace(piece, ends=piece.ends + np.outer(shift, normal))
        for piece, shift, normal, share in zip(pieces, shifts, normals, shares.tolist(), strict=True)
        if share + _SUPPORT_WORTH * min(piece.support, _MOST_SUPPORT) > _LEAST
    ]


def _free_reach(ends: Floats, normals: Floats, points: GroundPoints) -> Floats:
    """How far (p, 2) [m] the ridge may be from both ends (p, 2, 2) of pieces: as far as points may be."""
    ranges = np.maximum(np.hypot(ends[:, :, 0], ends[:, :, 1]), 1e-3)
    outward = np.abs((ends * normals[:, None]).sum(axis=2)) / ranges
    return tolerance(outward, 0.5 * points.along(ranges), 0.5 * points.across)


def _contrasts(brightness: Singles, widths: Floats) -> Singles:
    """Contrast (p, N, T) of a ridge at each sample of the profiles (p, N, T) to the brighter one of its sides.

    widths (p,): of the ridge, in samples. NaN, and a sample whose sides are not in the profile, has the contrast 0.
    """
    count = brightness.shape[1]
    width = np.clip(np.rint(widths), 1, _HALF // 4).astype(np.intp)
    half = width // 2
    hidden = np.isnan(brightness)
    sums = np.zeros((len(widths), count + 1, brightness.shape[2]), np.float32)
    np.cumsum(np.where(hidden, np.float32(0.0), brightness), axis=1, out=sums[:, 1:])
    samples = np.arange(count)
    # First sample, and the one behind the last, of the left side, the ridge and the right side around each sample.
    edges = np.array([-half - 2 * width - 1, -half - width + 1, -half, half + 1, half + width, half + 2 * width + 2])
    at = np.clip(edges[:, :, None] + samples, 0, count)  # (6, p, N)
    parts = sums[np.arange(len(widths))[:, None], at]  # (6, p, N, T)
    sizes = np.maximum(at[1::2] - at[::2], 1).astype(np.float32)
    left, ridge, right = (parts[1::2] - parts[::2]) / sizes[..., None]
    surroundings = sums[:, -1].sum(axis=1) / (count * brightness.shape[2]) + _DARK
    contrasts = (ridge - np.maximum(left, right)) / surroundings[:, None, None]
    contrasts[hidden | (np.abs(samples - _HALF) > _HALF - (width + half)[:, None])[..., None]] = 0.0
    return np.asarray(np.clip(contrasts, *_LIMITS))


def _best_shifts(contrasts: Singles, free: Floats, lengths: Floats) -> tuple[Floats, Floats]:
    """Shifts (p, 2) [m] of the ends of pieces that have the highest mean contrast, and the share of stations (p,) with
    a ridge there.

    contrasts (p, N, T): see _contrasts. free (p, 2) [m]: how far the ridge may be from the ends. lengths (p,) [m]: of
    the pieces.
    """
    shifts = _TRIED * free[:, None]  # (p, S, 2)
    spans = (free + _MARGIN) @ (_SHARES.T / _HALF)  # (p, T): of a sample
    samples = np.rint((shifts @ _SHARES.T) / spans[:, None]).astype(np.intp) + _HALF  # (p, S, T)
    rows, stations = np.arange(len(free)), np.arange(_STATIONS)
    totals = contrasts[rows[:, None, None], samples, stations].sum(axis=2)
    totals[np.abs(shifts[:, :, 1] - shifts[:, :, 0]) > _TURN * lengths[:, None]] = -np.inf
    best = np.argmax(totals, axis=1)
    near = samples[rows, best][:, None] + np.array([[-1], [0], [1]])  # (p, 3, T): the ridge may weave by a sample
    shown = contrasts[rows[:, None, None], np.clip(near, 0, 2 * _HALF), stations].max(axis=1)
    return shifts[rows, best], np.count_nonzero(shown > _CONTRAST, axis=1) / _STATIONS
