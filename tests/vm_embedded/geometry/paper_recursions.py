"""The paper's recursions as it prints them.

Meshes are built from closed forms of these equations (`circle.py` and `sphere.py` of the package). The tests compare
the two.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

from vm_embedded.errors import GeometryError

Step = Callable[[float, float, float], float]
"""(phi [rad], radius [m], height [m]) -> next phi [rad]."""


def circle_phi1(phi: float, radius: float, height: float) -> float:
    """Inclination [rad] one circle further out; the paper's eqn:circle_phi1."""
    return math.atan(math.tan(phi) + 2.0 * radius / height)


def circle_dtheta(phi: float, radius: float, height: float) -> float:
    """Azimuth angle (around the vertical) [rad] that a circle or a sphere covers; the paper's eqn:circle_dtheta.

    Raises GeometryError where the object covers the point below the camera.
    """
    sine = radius / (height * math.tan(phi)) if phi > 0 else math.inf
    if sine > 1.0:
        raise GeometryError(f"an object of radius {radius:g} m covers the nadir at phi = {phi:g} rad and has no width")
    return 2.0 * math.asin(sine)


def sphere_phi_1(phi: float, radius: float, height: float) -> float:
    """Inclination [rad] one sphere further out; the paper's eqn:sphere_phi_1."""
    return 2.0 * math.atan(radius / (math.cos(phi) * (height - radius)) + math.tan(phi)) - phi


def repeat(step: Step, times: int, phi: float, radius: float, height: float) -> float:
    """Inclination [rad] after `times` steps, `times` objects further out; the paper's f^times(phi, radius)."""
    for _ in range(times):
        phi = step(phi, radius, height)
    return phi


def sample_radius(intersections: Fraction, radius: float, height: float, step: Step = sphere_phi_1) -> float:
    """Radius [m] of the smaller objects of which `intersections` = p/q fit across one object of radius `radius` [m].

    The paper's section "Object Dependent Sample Density", fig:multi_sphere_intersections: q large objects reach as far
    as p small ones, f^q(0, r0) = f^p(0, r1), solved for r1 by bisection. The paper prints f^(pq) on the right side;
    that would mean p small objects across a large one, whatever q is.

    Raises GeometryError if `intersections` is not above 0.
    """
    if intersections <= 0:
        raise GeometryError(f"intersections must be above 0, not {intersections}")
    p, q = intersections.numerator, intersections.denominator
    target = repeat(step, q, 0.0, radius, height)
    # r1 is at most the size of q large objects side by side. Above h / 2 a sphere has no next phi.
    low, high = 0.0, q * radius if step is circle_phi1 else min(q * radius, height / 2.0)
    while high - low > 1e-15 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if repeat(step, p, 0.0, middle, height) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
