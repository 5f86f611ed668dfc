"""The shapes by their names in model files and configurations."""

from __future__ import annotations

from ..errors import InputError, unknown
from .circle import Circle
from .cylinder import Cylinder
from .shape import Shape
from .sphere import Sphere

SHAPES: dict[str, type[Shape]] = {"circle": Circle, "sphere": Sphere, "cylinder": Cylinder}


def make_shape(name: str, radius: float, object_height: float = 0.0) -> Shape:
    """The shape of this name (one of SHAPES, in either case) and radius [m].

    object_height: height of a cylinder [m]; 0 for all other shapes.

    Raises InputError for an unknown name or for a height of another shape than a cylinder, and GeometryError for a
    length that is not a positive number.
    """
    if name.lower() not in SHAPES:
        raise InputError(unknown("shape", name, SHAPES))
    kind = SHAPES[name.lower()]
    if issubclass(kind, Cylinder):
        return kind(radius, object_height)
    if object_height:
        raise InputError(
            f"only a cylinder takes an object height; remove the height {object_height:g} m from the {name.lower()}"
        )
    return kind(radius)
