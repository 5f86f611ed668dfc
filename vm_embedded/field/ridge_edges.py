"""The edges of lines in the picture: they give the width of a line, and its direction more exactly than its points.

Both tell whether the pose of the camera is right (pose_evidence.py). Only that needs them, so they are measured later
than the lines, and not for each frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Chosen, Floats, Mask, Singles

_REACH = 10
"""Samples on each side of a ridge that are searched for its edge."""

_WINDOW = np.arange(-_REACH, _REACH + 1)

_FEWEST = 5
"""Stations that must show both edges of a ridge to measure it."""

_NARROWEST = 5.0
"""Width of the narrowest ridge [px] that is measured."""

_SPREAD = 3.0
"""Blur widens a line by this much [px]: its square adds to that of the width."""

_ROUNDING = 0.25
"""Error of the place of a ridge [samples], at least."""


@dataclass(frozen=True, eq=False)
class Ridges:
    """Profiles across p pieces of lines, at T stations each, with N samples.

    brightness (p * T, N): NaN outside of the picture. at (p, T): positions of the ridges' samples among all of them.
    shown (p, T): which stations show a ridge. spans, pixels (p, T): of a sample [m], [px]. ends (p, 2, 2) [m]: of the
    pieces before they moved to the ridges, with normals (p, 2) and lengths (p,) [m]. stations (T,): shares of the
    length.
    """

    brightness: Singles
    at: Chosen
    shown: Mask
    spans: Floats
    pixels: Floats
    ends: Floats
    normals: Floats
    lengths: Floats
    stations: Floats

    def measured(self) -> tuple[Floats, Floats, Floats]:
        """Ends (p, 2, 2) [m] of the middle lines, standard deviations (p,) of their directions [rad], and widths (p,)
        [m], of the pieces that show enough edges. A width is NaN if the picture is too coarse for it."""
        places, wide = self._between_edges()
        inside = wide > 0.0
        count = inside.sum(axis=1)
        good = np.flatnonzero(count >= _FEWEST)
        inside, count, places, wide, spans = inside[good], count[good], places[good], wide[good], self.spans[good]
        # The straight line through the middles of both edges, weighted by the samples.
        weights = inside / (spans * spans)
        total = weights.sum(axis=1)
        off = places * spans
        middle, mean = (weights @ self.stations) / total, (weights * off).sum(axis=1) / total
        along = self.stations - middle[:, None]
        spread = (weights * along * along).sum(axis=1)
        slope = (weights * along * off).sum(axis=1) / spread
        rest = off - mean[:, None] - slope[:, None] * along
        noise = (weights * rest * rest).sum(axis=1) / (count - 2) + _ROUNDING**2
        moved = np.stack([mean - slope * middle, mean + slope * (1.0 - middle)], axis=1)
        ends = self.ends[good] + moved[:, :, None] * self.normals[good, None]
        shown = np.maximum(wide * self.pixels[good], 1e-6)
        sharp = np.sqrt(np.maximum(1.0 - (_SPREAD / shown) ** 2, 0.0))
        widths = np.where(inside & (shown > _NARROWEST), wide * spans * sharp, np.nan)
        return ends, np.sqrt(noise / spread) / self.lengths[good], _medians(widths)

    def _between_edges(self) -> tuple[Floats, Floats]:
        """The middles between both edges of the ridges (p, T), from the middle of their profiles, and their widths (p,
        T), both in samples; a width is 0 where an edge is not seen."""
        samples = self.brightness.shape[1]
        sample = self.at % samples - samples // 2
        around = sample[:, :, None] + _WINDOW
        values = self.brightness.take(self.at[:, :, None] + _WINDOW, mode="clip")  # (p, T, W)
        values = np.where((np.abs(around) > samples // 2) | (values != values), np.float32(np.inf), values)
        right, left = values[:, :, _REACH:], values[:, :, _REACH::-1]
        peak = values[:, :, _REACH - 1 : _REACH + 2].max(axis=2)
        half = 0.5 * (peak + np.maximum(right.min(axis=2), left.min(axis=2)))
        seen = self.shown & np.isfinite(half)
        edges = np.stack([right, left])  # (2, p, T, W / 2)
        first = (edges < half[:, :, None]).argmax(axis=3)  # behind the edge
        rows = np.arange(first.size) * edges.shape[3]
        behind = edges.ravel().take(rows + first.ravel()).reshape(first.shape)
        before = edges.ravel().take(rows + np.maximum(first.ravel() - 1, 0)).reshape(first.shape)
        seen = seen & (first > 0).all(axis=0) & np.isfinite(before).all(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):  # infinite where nothing is seen
            share = np.where(seen, (before - half) / (before - behind), np.float32(0.0))
        beyond, below = first - 1 + share
        return np.where(seen, sample + 0.5 * (beyond - below), 0.0), np.where(seen, beyond + below, 0.0)


def _medians(values: Floats) -> Floats:
    """Medians (p,) of values (p, T), of those that are not NaN; NaN if fewer than _FEWEST are."""
    count = (values == values).sum(axis=1)
    middle = np.sort(values, axis=1)[np.arange(len(values)), np.maximum(count - 1, 0) // 2]  # NaN is last
    return np.where(count >= _FEWEST, middle, np.nan)
