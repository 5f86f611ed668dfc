"""What a model file says about itself: one schema, written by the exporter and read by the runtime.

It travels as JSON in the .onnx file's metadata under the key `visual_mesh`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..arrays import Indices, Singles
from ..detection.color_normalization import COLORINGS
from ..errors import GeometryError, InputError, ModelError, unknown
from ..geometry.make_shape import SHAPES, make_shape
from ..geometry.shape import Shape
from ..mesh.mesh import MeshModel
from ..mesh.models import MESH_MODELS
from ..mesh.walls import wall_counts

METADATA_KEY = "visual_mesh"
FORMAT_VERSION = 5

KINDS = ("object", "upright", "area", "background")
"""What a class is. object: has the mesh's shape and is located. upright, area: points with bearings. background."""

EDGES = ("hard", "same")
"""Where a missing neighbor leads. hard: to the off-screen point, whose input is -1. same: to the point itself."""

LAYOUTS = ("plain", "runs", "lattice")
"""How the network takes its points. plain: as rows. runs: as columns, ring by ring. lattice: as a picture; see
layout.py."""

POINT_SAMPLINGS = ("bilinear", "footprint")
"""What color a point has. bilinear: of its place, between four pixels. footprint: of its surroundings; footprint.py."""

_LARGEST = 1e9
"""Beyond every radius, distance and number of rings."""


@dataclass(frozen=True)
class ObjectClass:
    """One output of the network: its name and its kind, one of KINDS."""

    name: str
    kind: str

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ModelError(f"name of a class must be text, not {self.name!r}")
        if self.kind not in KINDS:
            raise ModelError(unknown(f"kind of class {self.name!r}", self.kind, KINDS))


@dataclass(frozen=True, eq=False)
class SelfTest:
    """A small graph and its answer: points (n + 1, 3), neighbors (n + 1, N), probabilities (n + 1, C).

    cells (n, 2): of points on a lattice their columns and rows, as in Mesh, else None.
    """

    points: Singles
    neighbors: Indices
    probabilities: Singles
    cells: Indices | None = None

    def as_dict(self) -> dict[str, Any]:
        """Nested lists, with as many digits as the check needs."""
        return {
            "points": np.round(self.points.astype(float), 4).tolist(),
            "neighbors": self.neighbors.tolist(),
            "probabilities": np.round(self.probabilities.astype(float), 6).tolist(),
            "cells": None if self.cells is None else self.cells.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> SelfTest:
        """Inverse of `as_dict`. Raises ModelError."""
        try:
            test = cls(
                np.array(data["points"], dtype=np.float32),
                np.array(data["neighbors"], dtype=np.int32),
                np.array(data["probabilities"], dtype=np.float32),
                None if data["cells"] is None else np.array(data["cells"], dtype=np.int32).reshape(-1, 2),
            )
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ModelError(f"self-test in the model file can't be read: {error}") from error
        rows = len(test.points) if test.points.ndim == 2 else 0
        if rows < 1 or test.points.shape != (rows, 3) or test.neighbors.ndim != 2 or test.probabilities.ndim != 2:
            raise ModelError("self-test in the model file has arrays of the wrong shape")
        if len(test.neighbors) != rows or len(test.probabilities) != rows:
            raise ModelError("self-test in the model file has arrays of different lengths")
        if test.neighbors.size and not 0 <= test.neighbors.min() <= test.neighbors.max() < rows:
            raise ModelError("self-test in the model file has neighbors that are no points")
        if test.cells is not None:
            most = abs(test.cells).max(initial=0)
            if len(test.cells) != rows - 1 or most > 1000 or len(np.unique(test.cells, axis=0)) != rows - 1:
                raise ModelError("self-test in the model file has cells that are no places of its points")
        return test


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What the runtime must know to build the mesh and read the answers of a network.

    shape: one of SHAPES. radius: the object's radius that the mesh is made for [m]. object_radius: that of the real
    object [m]. object_height: of a cylinder [m], else 0. any_radius: whether the network knows objects of any radius,
    so that the mesh is made for the real one's, whatever it is. intersections: rings across an object of `radius`.
    mesh: one of MESH_MODELS. max_distance of the mesh [m]. edge: one of EDGES. classes: in the order of the network's
    outputs. layout: one of LAYOUTS; runs and lattice need edge hard. operations: multiplications and additions for each
    point. channels, scale: a point's input is its color in this order, times scale. sampling: one of POINT_SAMPLINGS.
    colors: one of COLORINGS. provenance: who made it from what. Raises ModelError for values that this runtime does not
    know.
    """

    shape: str
    radius: float
    object_radius: float
    intersections: float
    mesh: str
    max_distance: float
    edge: str
    classes: tuple[ObjectClass, ...]
    object_height: float = 0.0
    any_radius: bool = False
    self_test: SelfTest | None = None
    layout: str = "plain"
    operations: int = 0
    channels: str = "rgb"
    scale: float = 1.0 / 255.0
    sampling: str = "bilinear"
    colors: str = "absolute"
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        choices = {
            "shape": tuple(SHAPES),
            "mesh": tuple(MESH_MODELS),
            "edge": EDGES,
            "layout": LAYOUTS,
            "channels": ("rgb",),
            "sampling": POINT_SAMPLINGS,
            "colors": COLORINGS,
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise ModelError(unknown(f"{name} in the model's manifest", getattr(self, name), allowed))
        if self.layout != "plain" and self.edge != "hard":
            raise ModelError(f"layout {self.layout} needs edge hard; for edge {self.edge} there is layout plain")
        if self.layout == "lattice" and MESH_MODELS[self.mesh].steps is None:
            raise ModelError(f"layout lattice is for grids, whose neighbors are fixed steps away; {self.mesh} is none")
        for name in ("radius", "object_radius", "intersections", "max_distance", "scale"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= _LARGEST:
                raise ModelError(f"{name} in the model's manifest must be a number above 0, not {value!r}")
        self._check_shape()
        if isinstance(self.operations, bool) or not isinstance(self.operations, int) or self.operations < 0:
            raise ModelError(f"operations in the model's manifest must be a whole number, not {self.operations!r}")
        if not isinstance(self.any_radius, bool):
            raise ModelError(f"any_radius in the model's manifest must be true or false, not {self.any_radius!r}")
        if abs(self.scale * 255.0 - 1.0) > 1e-6:
            raise ModelError(f"scale in the model's manifest must be 1/255, not {self.scale!r}")
        names = [each.name for each in self.classes]
        if not names or len(set(names)) != len(names):
            raise ModelError(f"classes in the model's manifest must be one or more different names, not {names}")

    def _check_shape(self) -> None:
        tall = self.object_height
        if isinstance(tall, bool) or not isinstance(tall, int | float) or not 0 <= tall <= _LARGEST:
            raise ModelError(f"object_height in the model's manifest must be a number of at least 0, not {tall!r}")
        if (self.shape == "cylinder") != (tall > 0):
            raise ModelError(f"a cylinder has an object_height and no other shape has, but {self.shape} has {tall:g} m")
        if self.mesh != "wall6":
            return
        if self.shape != "cylinder":
            raise ModelError(f"mesh wall6 is for shape cylinder, not {self.shape}")
        if self.sampling != "bilinear":
            raise ModelError(f"mesh wall6 has no footprints: its sampling is bilinear, not {self.sampling}")
        for each in self.classes:
            if each.kind == "object":
                raise ModelError(
                    f"mesh wall6 does not locate objects, so class {each.name!r} can't be of kind object, but "
                    "upright or area"
                )
        try:
            wall_counts(self.mesh_shape, self.intersections, self.max_distance)
        except GeometryError as error:
            raise ModelError(f"the model's manifest has no mesh: {error}") from error

    def used_for(self, object_radius: float | None, max_distance: float | None) -> Manifest:
        """The manifest for real objects of a radius [m] and a mesh that reaches so far [m]; None for what it says."""
        radius = self.object_radius if object_radius is None else object_radius
        return replace(
            self,
            object_radius=radius,
            radius=radius if self.any_radius and object_radius is not None else self.radius,
            max_distance=self.max_distance if max_distance is None else max_distance,
        )

    def column(self, class_name: str) -> int:
        """Position of a class among the outputs. Raises InputError for an unknown one."""
        names = [each.name for each in self.classes]
        if class_name not in names:
            raise InputError(unknown("class", class_name, names))
        return names.index(class_name)

    @property
    def neighbors(self) -> int:
        """Neighbors of each point, N."""
        return self.model.neighbors

    @property
    def model(self) -> MeshModel:
        """How points are placed and linked."""
        return MESH_MODELS[self.mesh]

    @property
    def mesh_shape(self) -> Shape:
        """The shape that the mesh is made for."""
        return make_shape(self.shape, self.radius, self.object_height)

    @property
    def object_shape(self) -> Shape:
        """The shape of the real object."""
        return make_shape(self.shape, self.object_radius, self.object_height)

    def as_json(self) -> str:
        """The manifest as it stands in the model file."""
        data = asdict(self) | {"format_version": FORMAT_VERSION}
        data["self_test"] = self.self_test.as_dict() if self.self_test else None
        return json.dumps(data, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Manifest:
        """The manifest of a model file. Raises ModelError naming what is missing, unknown or of another version."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ModelError(f"the model's manifest is not JSON: {error}") from error
        if not isinstance(data, dict):
            raise ModelError("the model's manifest is not a table")
        version = data.pop("format_version", None)
        if version != FORMAT_VERSION:
            raise ModelError(
                f"the model's manifest has format version {version!r}, this release reads {FORMAT_VERSION}: "
                "make the file again with the tools of this release"
            )
        known = [each.name for each in fields(cls)]
        for key in data:
            if key not in known:
                raise ModelError(unknown("entry in the model's manifest", key, known))
        missing = [name for name in known if name not in data]
        if missing:
            raise ModelError(f"the model's manifest lacks {', '.join(missing)}")
        try:
            data["classes"] = tuple(ObjectClass(each["name"], each["kind"]) for each in data["classes"])
            data["provenance"] = {str(key): str(value) for key, value in data["provenance"].items()}
        except (TypeError, KeyError, AttributeError) as error:
            raise ModelError(f"the model's manifest has malformed classes or provenance: {error}") from error
        if data["self_test"] is not None:
            data["self_test"] = SelfTest.from_dict(data["self_test"])
        return cls(**data)
