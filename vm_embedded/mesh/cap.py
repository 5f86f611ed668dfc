"""Rings with a hexagonal cap around the point below the camera: as dense there as elsewhere, and six neighbors.

Around the nadir the rings' number of points is a makeshift, and neighbors in rings of such different sizes meet at any
angle. Here ring i has 6 i points, as the i-th hexagon of a hexagonal lattice. In the plane where an object n
objects out lies at the radius n, the lattice's middle is a true one; outwards its hexagons are rolled into circles,
until they are the mesh's rings.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Floats, Indices, frozen
from ..geometry.shape import Shape
from .mesh import Mesh, MeshModel, polar
from .rings import Rings, inclinations, places, ring_counts, ring_neighbors

_CORNER = math.sqrt(2.0 * math.pi / (3.0 * math.sqrt(3.0)))
"""Distance of a hexagon's corners, over the radius of the circle that has its area."""


class Cap(MeshModel):
    """ring6 with a hexagonal cap, and ring6's neighbors: between hexagons they are those of the lattice.

    The six corners of a hexagon have three neighbors outwards and one inwards in a lattice; here they have two and two
    like all other points, so that left and right are always within the ring.
    """

    neighbors = 6
    runs = Rings(6).runs

    def _build(self, shape: Shape, height: float, intersections: float, max_distance: float) -> Mesh:
        phi = inclinations(shape, height, intersections, max_distance)
        counts = ring_counts(shape, height, intersections, len(phi))
        rings = np.arange(len(counts), dtype=np.int32)
        # Hexagons are used as long as they have at most half a point less across an object than rings would.
        enough = 6 * rings >= (1.0 - 0.5 / max(intersections, 1.0)) * counts
        hexagons = int(np.argmin(np.append(enough | (rings <= intersections), False))) - 1
        counts[1 : hexagons + 1] = 6 * rings[1 : hexagons + 1]

        start, j = places(counts)
        radius, angle = np.repeat(rings / intersections, counts), 2.0 * np.pi * j / np.repeat(counts, counts)
        inner = start[hexagons + 1]
        radius[:inner], angle[:inner] = _rolled(np.repeat(rings, counts)[:inner], j[:inner], hexagons, intersections)
        rays = polar(shape.phi(radius, height), angle)
        return Mesh(frozen(rays), frozen(ring_neighbors(counts, start, j, self.neighbors, nudge=1e-6)))


def _rolled(ring: Indices, j: Indices, hexagons: int, intersections: float) -> tuple[Floats, Floats]:
    """Radius (n,) in objects and angle (n,) [rad] of the cap's points, j (n,) their place in their ring (n,)."""
    sides = np.maximum(ring, 1)
    side, along = j // sides, (j % sides) / sides
    corners = np.exp(1j * np.pi / 3.0 * np.arange(7))
    hexagon = _CORNER * ((1.0 - along) * corners[side] + along * corners[side + 1])
    circle = np.exp(1j * np.pi / 3.0 * (side + along))
    place = ring / intersections * (hexagon + ring / max(hexagons, 1) * (circle - hexagon))
    return np.abs(place), np.angle(place)
