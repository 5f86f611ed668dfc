"""A mesh together with what it was made for."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.geometry.shape import Shape
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import mesh_model
from vm_embedded.mesh.walls import wall_counts, wall_distances


@dataclass(frozen=True)
class Plan:
    """What a mesh is made for: an object's shape, camera height [m], intersections and reach [m]."""

    shape: Shape
    height: float
    intersections: float
    max_distance: float

    @property
    def whole(self) -> float:
        """Points on an object, over k^2: the share of its bounding box that an object fills."""
        return 1.0 if isinstance(self.shape, Cylinder) else math.pi / 4.0


@dataclass(frozen=True, eq=False)
class MadeMesh:
    """A model's mesh for a plan, and the milliseconds that building it took."""

    model: str
    plan: Plan
    mesh: Mesh
    build_ms: float

    @classmethod
    def build(cls, model: str, plan: Plan) -> MadeMesh:
        """Raises InputError or GeometryError as build_mesh does."""
        started = time.perf_counter()
        mesh = mesh_model(model).build(plan.shape, plan.height, plan.intersections, plan.max_distance)
        return cls(model, plan, mesh, 1e3 * (time.perf_counter() - started))

    @cached_property
    def walls(self) -> Indices | None:
        """The wall (n,) that each point of wall6 lies on, else None."""
        if self.model != "wall6":
            return None
        counts = wall_counts(self.plan.shape, self.plan.intersections, self.plan.max_distance)
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts * round(self.plan.intersections))

    @cached_property
    def distances(self) -> Floats:
        """Distance (n,) [m] from the camera's foot to the object that each point is meant for."""
        plan, rays = self.plan, self.mesh.rays
        if self.walls is not None:
            return np.asarray(wall_distances(plan.shape, plan.intersections, plan.max_distance)[self.walls])
        down = np.maximum(-rays[:, 2], 1e-9)
        return np.asarray(np.hypot(rays[:, 0], rays[:, 1]) / down * (plan.height - plan.shape.center_height))
