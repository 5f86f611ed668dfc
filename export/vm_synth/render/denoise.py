"""Taking the grain out of traced light, which no camera shows in that way."""

from __future__ import annotations

import cv2
import numpy as np

from vm_embedded.arrays import Singles

_STEPS = (1, 2, 4)
_NORMALS = 16.0  # how sharply other directions are told apart
_DEPTHS = 30.0  # and other distances, as a share of the distance


def smoothed(light: Singles, albedo: Singles, normal: Singles, depth: Singles, share: Singles) -> Singles:
    """Light (h, w, 3) without grain where share (h, w) is above 0.

    The light that falls on a surface, light over albedo (h, w, 3), is averaged with that on the neighbors that face
    the same way, normal (h, w, 3), at the same distance, depth (h, w); in three rounds, each reaching twice as far
    (the edge-avoiding a-trous wavelet transform of Dammertz et al.).
    """
    color = albedo + np.float32(0.03)
    falling = light / color
    guide = np.concatenate([normal * np.float32(np.sqrt(_NORMALS)), (np.log(depth) * _DEPTHS)[..., None]], axis=-1)
    guide = guide.astype(np.float32)
    around = _padded(guide), _padded(share)
    for step in _STEPS:
        total, weights = falling * share[..., None], share.copy()
        lit = _padded(falling)
        for down in (-step, 0, step):
            for right in (-step, 0, step):
                if down or right:
                    apart = _moved(around[0], down, right) - guide
                    weight = cv2.exp(-np.einsum("...c,...c->...", apart, apart)) * _moved(around[1], down, right)
                    total += _moved(lit, down, right) * weight[..., None]
                    weights += weight
        falling = total / np.maximum(weights, 1e-6)[..., None]
    return np.where(share[..., None] > 0, falling * color, light)


def _padded(values: Singles) -> Singles:
    edge = max(_STEPS)
    return np.pad(values, ((edge, edge), (edge, edge), (0, 0))[: values.ndim], mode="edge")


def _moved(padded: Singles, down: int, right: int) -> Singles:
    """The values at (row + down, column + right)."""
    edge = max(_STEPS)
    rows, columns = padded.shape[0] - edge, padded.shape[1] - edge
    return padded[edge + down : rows + down, edge + right : columns + right]
