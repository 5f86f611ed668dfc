"""The mesh models by their names in model files and configurations."""

from __future__ import annotations

from ..errors import InputError, unknown
from ..geometry.shape import Shape
from .cap import Cap
from .grids import KINDS, Grid
from .mesh import Mesh, MeshModel
from .octaves import Octaves
from .rings import Rings
from .walls import Walls

MESH_MODELS: dict[str, MeshModel] = {
    **{f"ring{each}": Rings(each) for each in (4, 6, 8)},
    **{f"{kind}grid{each}": Grid(kind, each) for kind in KINDS for each in (4, 6, 8)},
    "cap6": Cap(),
    "wall6": Walls(),
    "octaves": Octaves(),
}
"""The reference's twelve models, cap6 (as dense below the camera as elsewhere), wall6 (for tall cylinders) and octaves
(strips for ordinary convolutions)."""


def mesh_model(name: str) -> MeshModel:
    """The mesh model of this name. Raises InputError for an unknown name."""
    if name not in MESH_MODELS:
        raise InputError(unknown("mesh model", name, MESH_MODELS))
    return MESH_MODELS[name]


def build_mesh(shape: Shape, height: float, intersections: float, max_distance: float, model: str = "ring6") -> Mesh:
    """The mesh for objects of this shape, seen from a height [m], out to `max_distance` [m].

    intersections: rings of points across an object (the paper's k). model: one of MESH_MODELS.

    Raises InputError for an unknown model, and GeometryError for arguments that the model cannot build a mesh from.
    """
    return mesh_model(model).build(shape, height, intersections, max_distance)
