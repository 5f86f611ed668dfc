"""Answers of a network that knows where the objects are, for the tests of peaks and of looks at them."""

import numpy as np


def cells_to(view, ray):
    """Right and up [cells] from each slot (m,) to a ray (3,): by the azimuths and inclinations of columns and rows, and
    on the plane around the foot. NaN in gaps."""
    layout = view.layout
    right, up = np.full((2, len(layout)), np.nan)
    for piece in layout.pieces:
        box = np.arange(len(layout)).reshape(layout.shape)[piece.region]
        x, y, z = layout.rays[box].transpose(2, 0, 1)
        held = np.isfinite(z)
        row, cells, used = np.nonzero(held)[0], box[held], np.flatnonzero(held.any(axis=1))
        lowest, highest = (find(z[used], axis=1) for find in (np.nanmin, np.nanmax))
        if (highest - lowest).max() > 1e-9:  # a lattice of the plane
            step = np.nanmax(np.abs(np.diff(-y / z, axis=1)))
            right[cells] = (ray[1] / ray[2] - (y / z)[held]) / step
            up[cells] = ((x / z)[held] - ray[0] / ray[2]) / step
            continue
        around = np.arctan2(y, x)
        steps = np.abs(wrapped(np.diff(around, axis=1)))
        if np.isfinite(steps).any():
            right[cells] = wrapped(around[held] - np.arctan2(ray[1], ray[0])) / np.nanmean(steps)
            inclinations = np.arccos(-lowest)
            at = np.interp(np.arccos(-ray[2]), inclinations[::-1], used[::-1], left=np.nan, right=np.nan)
            up[cells] = row - at
    return right, up


def wrapped(angles):
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def answers_of(view, manifest, objects):
    """Answers (m, outputs) of a network that knows objects: rows (class, ray, log size, height of the score)."""
    answers = np.zeros((len(view.layout), manifest.outputs), dtype=np.float32)
    first = len(manifest.classes)
    answers[:, first::4] = -12.0
    for name, ray, size, top in objects:
        own = answers[:, first + 4 * manifest.peaks.index(name) :][:, :4]
        right, up = cells_to(view, ray)
        score = np.nan_to_num(top - 3.0 * (right**2 + up**2), nan=-np.inf)
        better = score > own[:, 0]
        own[better] = np.stack([score, right, up, np.full(len(score), size)], axis=1)[better]
    return answers
