"""Answers of a network that knows where the objects are, for the tests of peaks and of looks at them."""

import numpy as np


def cells_to(view, ray):
    """Right and up [cells] from each point (n,) of the mesh to a ray (3,): by the azimuths and inclinations of columns
    and rows, and on the plane around the foot."""
    mesh = view.mesh
    right, up = np.full((2, len(mesh)), np.nan)
    for strip in np.unique(mesh.strips):
        points = np.flatnonzero(mesh.strips == strip)
        (column, row), (x, y, z) = mesh.cells[points].T, mesh.rays[points].T
        rows, first, number = np.unique(row, return_index=True, return_inverse=True)
        if np.abs(z - z[first][number]).max() > 1e-9:  # a lattice of the plane
            step = np.ptp(y / z) / np.ptp(column)
            right[points], up[points] = (ray[1] / ray[2] - y / z) / step, (x / z - ray[0] / ray[2]) / step
            continue
        around, order = np.arctan2(y, x), np.lexsort([column, row])
        beside = (np.diff(row[order]) == 0) & (np.diff(column[order]) == 1)
        if beside.any():
            step = np.abs(wrapped(np.diff(around[order])))[beside].mean()
            right[points] = wrapped(around - np.arctan2(ray[1], ray[0])) / step
            up[points] = np.interp(np.arccos(-ray[2]), np.arccos(-z[first]), rows, left=np.nan, right=np.nan) - row
    return right, up


def wrapped(angles):
    return (angles + np.pi) % (2.0 * np.pi) - np.pi


def answers_of(view, manifest, objects):
    """Answers (n, outputs) to the points of the mesh by a network that knows objects: rows (class, ray, log size,
    height of the score)."""
    answers = np.zeros((len(view.mesh), manifest.outputs), dtype=np.float32)
    first = len(manifest.classes)
    answers[:, first::4] = -12.0
    for name, ray, size, top in objects:
        own = answers[:, first + 4 * manifest.peaks.index(name) :][:, :4]
        right, up = cells_to(view, ray)
        score = np.nan_to_num(top - 3.0 * (right**2 + up**2), nan=-np.inf)
        better = score > own[:, 0]
        own[better] = np.stack([score, right, up, np.full(len(score), size)], axis=1)[better]
    return answers
