"""A mesh together with its plan: the object, camera and reach that it is built for."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vm_embedded.arrays import Floats, Indices
from vm_embedded.geometry.shape import Shape
from vm_embedded.geometry.shapes import Cylinder
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.mesh.models import mesh_model
from vm_embedded.mesh.walls import wall_counts, wall_distances


@dataclass(frozen=True)
class MeshPlan:
    """Parameters of a mesh: the object's shape, the camera height [m], the paper's k and the reach [m]."""

    shape: Shape
    height: float
    intersections: float
    max_distance: float

    @property
    def filled_share(self) -> float:
        """The share of its bounding box that an object fills: points on the object, divided by k^2."""
        return 1.0 if isinstance(self.shape, Cylinder) else math.pi / 4.0

    def __str__(self) -> str:
        return f"{self.shape}, camera {self.height:g} m high, k = {self.intersections:g}, reach {self.max_distance:g} m"


@dataclass(frozen=True, eq=False)
class BuiltMesh:
    """The mesh of a model for a plan, and the time that it took to build [ms]."""

    model: str
    plan: MeshPlan
    mesh: Mesh
    build_ms: float

    @classmethod
    def build(cls, model: str, plan: MeshPlan) -> BuiltMesh:
        """Build the mesh. Raises InputError or GeometryError as build_mesh does."""
        started = time.perf_counter()
        mesh = mesh_model(model).build(plan.shape, plan.height, plan.intersections, plan.max_distance)
        return cls(model, plan, mesh, 1e3 * (time.perf_counter() - started))

    @cached_property
    def walls(self) -> Indices | None:
        """The number (n,) of each point's wall in a wall6 mesh (docs/meshes.md); None for other models."""
        if self.model != "wall6":
            return None
        counts = wall_counts(self.plan.shape, self.plan.intersections, self.plan.max_distance)
        return np.repeat(np.arange(len(counts), dtype=np.int32), counts * round(self.plan.intersections))

    @cached_property
    def distances(self) -> Floats:
        """Distance (n,) [m] from the camera's foot, the point of the plane below it, to the object that each point
        serves."""
        plan, rays = self.plan, self.mesh.rays
        if self.walls is not None:
            return np.asarray(wall_distances(plan.shape, plan.intersections, plan.max_distance)[self.walls])
        down = np.maximum(-rays[:, 2], 1e-9)
        return np.asarray(np.hypot(rays[:, 0], rays[:, 1]) / down * (plan.height - plan.shape.center_height))
