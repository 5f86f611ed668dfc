"""Model cap6: rings, with hexagons of points around the nadir that are as dense there as elsewhere.

The paper calls the point below the camera a singularity of its mesh (section "Discussion and Conclusion"). The rings
around it have a makeshift number of points, and links between rings of very different sizes meet at any angle.

Here ring i has 6 i points there, like the i-th hexagon of a hexagonal lattice. Imagine a drawing of the plane, in which
a point's distance from the middle is the number of objects that fit between the two. In this drawing, every object has
the length 1 in the direction away from the middle. A hexagonal lattice has the same density everywhere in this drawing,
also in the middle. From the middle outwards the hexagons gradually become circles, and continue as the rings of the
paper's mesh.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..geometry.shape import Shape
from .mesh import Mesh, MeshModel, rays_from_polar
from .rings import Rings, inclinations, ring_counts, ring_neighbors, ring_places

_CORNER = math.sqrt(2.0 * math.pi / (3.0 * math.sqrt(3.0)))
"""Distance of a hexagon's corners from its center, relative to the radius of a circle with the same area."""


class Cap(MeshModel):
    """ring6 with a hexagonal cap, linked by the rule of ring6. Between hexagons this gives the links of the lattice.

    The only exceptions are the six corners of a hexagon. In a lattice a corner has three neighbors outwards and one
    inwards; here it has two and two, like all other points. So left and right always stay in the ring.
    """

    neighbors = 6
    mirrored = Rings(6).mirrored

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        phi = inclinations(shape, height, intersections, max_distance)
        counts = ring_counts(shape, height, intersections, len(phi))
        rings = np.arange(len(counts), dtype=np.int32)
        # In the ring's direction, a ring puts k points on an object. Hexagons of the cap put at least k - 1/2 on it, or
        # k / 2 for k below 1. Rings up to k belong to the cap in any case.
        enough = 6 * rings >= (1.0 - 0.5 / max(intersections, 1.0)) * counts
        hexagons = int(np.argmin(np.append(enough | (rings <= intersections), False))) - 1
        counts[1 : hexagons + 1] = 6 * rings[1 : hexagons + 1]

        start, place = ring_places(counts)
        radius, angle = np.repeat(rings / intersections, counts), 2.0 * np.pi * place / np.repeat(counts, counts)
        inner = start[hexagons + 1]
        radius[:inner], angle[:inner] = _cap(np.repeat(rings, counts)[:inner], place[:inner], hexagons, intersections)
        rays = rays_from_polar(shape.phi(radius, height), angle)
        return Mesh(frozen(rays), frozen(ring_neighbors(counts, start, place, self.neighbors, nudge=1e-6)))


def _cap(ring: Indices, place: Indices, hexagons: int, intersections: float) -> tuple[Floats, Floats]:
    """Radius (n,) [objects] and angle (n,) [rad] of the cap's points, from their ring (n,) and their place in it (n,).

    Points of the innermost hexagon lie on a hexagon, those of the last one on a circle, and all others in between.
    """
    sides = np.maximum(ring, 1)
    side, along = place // sides, (place % sides) / sides
    corners = np.exp(1j * np.pi / 3.0 * np.arange(7))
    hexagon = _CORNER * ((1.0 - along) * corners[side] + along * corners[side + 1])
    circle = np.exp(1j * np.pi / 3.0 * (side + along))
    point = ring / intersections * (hexagon + ring / max(hexagons, 1) * (circle - hexagon))
    return np.abs(point), np.angle(point)
