"""Removes the noise of path tracing from the light on surfaces."""

from __future__ import annotations

import cv2
import numpy as np

from vm_embedded.arrays import Singles

_STEPS = (1, 2, 4)
_NORMALS = 16.0  # how strongly a difference of directions lowers the weight of a neighbor
_DEPTHS = 30.0  # the same for a relative difference of distances
_LEAST = 1e-6  # a pixel whose weights add up to less keeps its light: their quotient would be rounding errors


def denoise(light: Singles, albedo: Singles, normal: Singles, depth: Singles, share: Singles) -> Singles:
    """Light (h, w, 3) with less noise where share (h, w) is above 0; unchanged elsewhere.

    The incoming light (light divided by albedo (h, w, 3)) of a pixel is averaged with that of neighbors with a similar
    normal (h, w, 3) and depth (h, w). Three rounds double the distance of the neighbors each time: the edge-avoiding
    a-trous wavelet transform (Dammertz et al., 2010).
    """
    # Channels come first: NumPy is slow with arrays whose last axis is short.
    color = _planes(albedo + np.float32(0.03))
    falling = _planes(light) / color
    guide = np.concatenate([_planes(normal) * np.float32(np.sqrt(_NORMALS)), (np.log(depth) * _DEPTHS)[None]])
    around = _padded(guide.astype(np.float32)), _padded(share)
    for step in _STEPS:
        total, weights = falling * share, share.copy()
        lit = _padded(falling)
        alike = {way: _likeness(around[0], *way) for way in ((0, step), (step, -step), (step, 0), (step, step))}
        for down in (-step, 0, step):
            for right in (-step, 0, step):
                if down or right:
                    # The likeness of two pixels is that of the opposite direction, seen from the other pixel.
                    same = (
                        _shifted(alike[down, right], 0, 0)
                        if (down, right) in alike
                        else _shifted(alike[-down, -right], down, right)
                    )
                    weight = same * _shifted(around[1], down, right)
                    total += _shifted(lit, down, right) * weight
                    weights += weight
        falling = np.where(weights > _LEAST, total / np.maximum(weights, _LEAST), falling)
    return np.where(share[..., None] > 0, np.moveaxis(falling * color, 0, -1), light)


def _likeness(guide: Singles, down: int, right: int) -> Singles:
    """How alike pixels of a padded guide (c, h, w) and those at (row + down, column + right) are (h, w), 0 to 1."""
    height, width = guide.shape[1:]
    rows, columns = height - down, slice(max(-right, 0), width - max(right, 0))
    there = slice(columns.start + right, columns.stop + right)
    x, y, z, away = (guide[:, down:, there] - guide[:, :rows, columns]) ** 2
    alike = np.zeros((height, width), dtype=np.float32)
    alike[:rows, columns] = cv2.exp(-((x + y) + (z + away)))
    return alike


def _planes(image: Singles) -> Singles:
    """An image (h, w, c) as planes (c, h, w)."""
    return np.ascontiguousarray(np.moveaxis(image, -1, 0))


def _padded(values: Singles) -> Singles:
    """Values (h, w) or (c, h, w) with a border that repeats the edge."""
    edge = max(_STEPS)
    return np.pad(values, ((0, 0), (edge, edge), (edge, edge))[-values.ndim :], mode="edge")


def _shifted(padded: Singles, down: int, right: int) -> Singles:
    """The unpadded values at (row + down, column + right)."""
    edge = max(_STEPS)
    rows, columns = padded.shape[-2] - edge, padded.shape[-1] - edge
    return padded[..., edge + down : rows + down, edge + right : columns + right]
