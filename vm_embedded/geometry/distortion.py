"""Radial distortion of the reference's lenses: a polynomial from distorted to undistorted radii, and its inverse."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Number


def undistort(radius: Number, distortion: tuple[float, float]) -> Number:
    """Undistorted radius r_u = r_d (1 + k0 r_d^2 + k1 r_d^4); radii [px], distortion (k0, k1) [px^-2, px^-4]."""
    k0, k1 = distortion
    square = radius * radius
    return radius * (1.0 + square * (k0 + square * k1))


def distort(radius: Floats, distortion: tuple[float, float]) -> Floats:
    """Distorted radius r_d [px] (n,) from the undistorted one (n,), to 1e-9 px; inverse of `undistort`.

    Newton's method between bounds: a step that would leave the bounds goes to their middle instead. Radii beyond
    `monotone_radius` give the distorted radius there.
    """
    k0, k1 = distortion
    largest = monotone_radius(distortion)
    target = np.minimum(radius, undistort(largest, distortion)) if math.isfinite(largest) else radius
    # A polynomial that always grows is at least 4/9 of its argument everywhere.
    low, high = np.zeros_like(target), np.minimum(2.25 * target, largest)
    distorted = np.minimum(target, high)
    moving = np.ones(target.shape, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(100):
            square = distorted * distorted
            error = undistort(distorted, distortion) - target
            low, high = np.where(error < 0, distorted, low), np.where(error > 0, distorted, high)
            newton = distorted - error / (1.0 + square * (3.0 * k0 + square * 5.0 * k1))
            better = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
            # Each radius stops on its own iteration. So its digits do not depend on the other radii.
            moving &= np.abs(better - distorted) > 1e-10
            if not moving.any():
                break
            distorted = np.where(moving, better, distorted)
    return distorted


def monotone_radius(distortion: tuple[float, float]) -> float:
    """Distorted radius [px] up to which `undistort` grows; infinity if it grows everywhere."""
    k0, k1 = distortion
    if k0 == 0.0 and k1 == 0.0:
        return math.inf
    # The slope 1 + 3 k0 s + 5 k1 s^2 with s = r_d^2, solved for 1 / s. This stays exact where k0 or k1 is tiny.
    discriminant = 9.0 * k0 * k0 - 20.0 * k1
    if discriminant < 0.0:
        return math.inf
    root = math.sqrt(discriminant)
    largest = (root - 3.0 * k0) / 2.0 if k0 <= 0.0 else -10.0 * k1 / (root + 3.0 * k0)
    return 1.0 / math.sqrt(largest) if largest > 0.0 else math.inf
