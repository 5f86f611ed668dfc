"""The description in a model file: one schema, written by the exporter and read by the runtime.

It travels as JSON in the .onnx file's metadata under the key `visual_mesh`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from types import UnionType

from ..borders.text import name_fault
from ..errors import GeometryError, InputError, ModelError, unknown
from ..geometry.shape import Shape
from ..geometry.shapes import SHAPES, make_shape
from ..mesh.mesh import MeshModel
from ..mesh.models import MESH_MODELS
from ..mesh.walls import wall_counts
from .look_contract import LookContract, check_provenance
from .self_test import SelfTest

METADATA_KEY = "visual_mesh"
FORMAT_VERSION = 7

KINDS = ("object", "upright", "area", "background")
"""Kinds of classes. object: has the mesh's shape; the runtime locates it. upright, area: the runtime reports its points
with bearings. background: everything else."""

EDGES = ("hard", "same")
"""Replacement of a missing neighbor. hard: the off-screen point, whose input is -1. same: the point itself."""

LAYOUTS = ("plain", "runs", "canvas")
"""Order of the points in the network's input; see layout.py. plain: point by point. runs: slots, ring by ring. canvas:
the strips of mesh octaves on a picture."""

POINT_SAMPLINGS = ("bilinear", "footprint")
"""Color of a point. bilinear: at its pixel, from the four around it. footprint: the mean of the area that it stands
for; see detection/footprint.py."""

POINT_COLORS = ("absolute", "relative")
"""Colors that the network takes. absolute: from 0 to 1. relative: normalized with the mean and the deviation of the
picture's points; see detection/sampling.py."""

_LARGEST = 1e9
"""Limit of every radius, distance, number of rings and number of operations."""

MOST_CLASSES = 127
"""Most classes of a network: the labels of a training are signed bytes."""

PEAK_OUTPUTS = 4
"""Outputs for a class with peaks: score, shift to the right and up, size; see `Manifest.peaks`."""

_SMALLEST_CIRCLE = 0.01
"""Smallest `upright_radius` of a look at uprights [m]."""


def _is_number(value: object, kind: type | UnionType = int | float) -> bool:
    """Whether a value is a number of this kind. In Python True and False are whole numbers, too; here they are not."""
    return isinstance(value, kind) and not isinstance(value, bool)


@dataclass(frozen=True)
class ObjectClass:
    """One output of the network: its name and its kind, one of KINDS.

    Raises ModelError for another kind, and for a name that can't be printed or is too long (see text.py).
    """

    name: str
    kind: str

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ModelError(f"name of a class must be a string, not {self.name!r}")
        if fault := name_fault(self.name):
            raise ModelError(f"name of class {self.name!r} {fault}")
        if self.kind not in KINDS:
            raise ModelError(unknown(f"kind of class {self.name!r}", self.kind, KINDS))


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Everything that the runtime must know to build the mesh and to read the network's answers.

    shape: of the object, one of SHAPES.
    radius: of the object that the mesh is made for [m].
    object_radius: of the real object [m].
    intersections: rings of points across an object of `radius` (the paper's k).
    mesh: one of MESH_MODELS.
    max_distance: of the mesh [m].
    edge: one of EDGES.
    classes: in the order of the network's outputs, at most MOST_CLASSES.
    object_height: of a cylinder [m], else 0.
    any_radius: the network was trained on objects of many radii, so the mesh is made for the real one's.
    self_test: an example with its answer, which each loading of the model file runs.
    layout: one of LAYOUTS; all but plain need edge hard, and canvas mesh octaves.
    operations: multiplications and additions for each point.
    channels: their order in a point's input, which is the point's color times `scale`.
    scale: see `channels`.
    sampling: one of POINT_SAMPLINGS.
    colors: one of POINT_COLORS.
    look: description of the look network, if the file has one; see close_look.py.
    upright_looks: descriptions of the look networks for classes of kind upright.
    peaks: names of classes of kind object or upright, for which the network also says where objects are; only in
        layout canvas. After the probabilities of all classes, each of them has four outputs for each cell: the score, a
        logit of whether the place of an object is in the cell; the shift to the right and up from the cell to this
        place [cells]; and the natural logarithm of the object's width over the diameter of the object that the mesh is
        made for. The place is the center of an object, or the base of an upright.
    provenance: origin of the file; the runtime does not use it.

    Raises ModelError for unknown values.
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
    look: LookContract | None = None
    upright_looks: tuple[LookContract, ...] = ()
    peaks: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        choices = {
            "shape": tuple(SHAPES),
            "mesh": tuple(MESH_MODELS),
            "edge": EDGES,
            "layout": LAYOUTS,
            "channels": ("rgb",),
            "sampling": POINT_SAMPLINGS,
            "colors": POINT_COLORS,
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                raise ModelError(unknown(f"{name} in the model's manifest", getattr(self, name), allowed))
        if self.layout != "plain" and self.edge != "hard":
            raise ModelError(f"layout {self.layout} needs edge hard; edge {self.edge} needs layout plain")
        if (self.layout == "canvas") != (self.mesh == "octaves"):
            raise ModelError(
                f"mesh octaves and layout canvas need each other; the mesh is {self.mesh}, the layout {self.layout}"
            )
        for name in ("radius", "object_radius", "intersections", "max_distance", "scale"):
            value = getattr(self, name)
            if not _is_number(value) or not 0 < value <= _LARGEST:
                raise ModelError(f"{name} in the model's manifest must be a number above 0, not {value!r}")
        self._check_object_height()
        self._check_peaks()
        self._check_looks()
        if self.mesh == "wall6":
            self._check_walls()
        if not _is_number(self.operations, int) or not 0 <= self.operations <= _LARGEST:
            raise ModelError(f"operations in the model's manifest must be a whole number, not {self.operations!r}")
        if not isinstance(self.any_radius, bool):
            raise ModelError(f"any_radius in the model's manifest must be true or false, not {self.any_radius!r}")
        if abs(self.scale * 255.0 - 1.0) > 1e-6:
            raise ModelError(f"scale in the model's manifest must be 1/255, not {self.scale!r}")
        names = [each.name for each in self.classes]
        if not 1 <= len(names) <= MOST_CLASSES or len(set(names)) != len(names):
            raise ModelError(
                f"classes in the model's manifest must be 1 to {MOST_CLASSES}, with different names, not "
                f"{len(names)}: {names}"
            )
        check_provenance(self.provenance)

    def _check_peaks(self) -> None:
        able = [each.name for each in self.classes if each.kind in ("object", "upright")]
        for each in self.peaks:
            if each not in able:
                raise ModelError(unknown("class of kind object or upright in the manifest's peaks", each, able))
        if len(set(self.peaks)) != len(self.peaks):
            raise ModelError(f"peaks in the model's manifest must be different classes, not {list(self.peaks)}")
        if self.peaks and self.layout != "canvas":
            raise ModelError(f"peaks need layout canvas, not {self.layout}")

    def _check_object_height(self) -> None:
        tall = self.object_height
        if not _is_number(tall) or not 0 <= tall <= _LARGEST:
            raise ModelError(f"object_height in the model's manifest must be a number of at least 0, not {tall!r}")
        if (self.shape == "cylinder") != (tall > 0):
            raise ModelError(
                f"object_height must be above 0 for a cylinder and 0 for other shapes; {self.shape} has {tall:g} m"
            )

    @property
    def looks(self) -> tuple[LookContract, ...]:
        """The descriptions of all look networks: at objects, then at uprights."""
        return self.upright_looks if self.look is None else (self.look, *self.upright_looks)

    def _check_looks(self) -> None:
        objects = [each.name for each in self.classes if each.kind == "object"]
        if self.look is not None and self.look.object_class not in objects:
            raise ModelError(
                f"the close look judges class {self.look.object_class!r}, but the classes of kind object are {objects}"
            )
        if self.look is not None and self.look.upright_radius:
            raise ModelError(
                f"the close look at objects has an upright_radius of {self.look.upright_radius:g} m; it must be 0"
            )
        for each in self.looks:
            if each.mesh_weight and each.object_class not in self.peaks:
                raise ModelError(
                    f"the close look at {each.object_class!r} has a mesh_weight of {each.mesh_weight:g}, but the "
                    f"network has peaks only for {list(self.peaks)}; without peaks it must be 0"
                )
        uprights = [each.name for each in self.classes if each.kind == "upright"]
        judged = [each.object_class for each in self.upright_looks]
        if len(set(judged)) != len(judged) or not set(judged) <= set(uprights):
            raise ModelError(
                f"there are close looks at the uprights {judged}, but the classes of kind upright are {uprights}"
            )
        for each in self.upright_looks:
            if each.upright_radius < _SMALLEST_CIRCLE:
                raise ModelError(
                    f"the close look at {each.object_class!r} must have an upright_radius of at least "
                    f"{_SMALLEST_CIRCLE} m, not {each.upright_radius:g} m"
                )

    def _check_walls(self) -> None:
        """Mesh wall6 is for cylinders, its points have no footprints, and the runtime does not locate objects on it."""
        if self.shape != "cylinder":
            raise ModelError(f"mesh wall6 needs shape cylinder, not {self.shape}")
        if self.sampling != "bilinear":
            raise ModelError(f"mesh wall6 needs sampling bilinear, not {self.sampling}")
        for each in self.classes:
            if each.kind == "object":
                raise ModelError(
                    f"mesh wall6 does not locate objects: the kind of class {each.name!r} must be upright or area"
                )
        try:
            wall_counts(self.mesh_shape, self.intersections, self.max_distance)
        except GeometryError as error:
            raise ModelError(f"the model's manifest describes a mesh that can't be built: {error}") from error

    def used_for(self, object_radius: float | None, max_distance: float | None) -> Manifest:
        """The manifest for another radius of the real object [m] and reach of the mesh [m]; None keeps its own."""
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
    def outputs(self) -> int:
        """Outputs of the network for each point: the probabilities of the C classes, then four for each of P peaks."""
        return len(self.classes) + PEAK_OUTPUTS * len(self.peaks)

    @property
    def neighbors(self) -> int:
        """Neighbors of each point, N."""
        return self.model.neighbors

    @property
    def model(self) -> MeshModel:
        """The mesh model, which places and links the points."""
        return MESH_MODELS[self.mesh]

    @cached_property
    def mesh_shape(self) -> Shape:
        """The shape that the mesh is made for."""
        return make_shape(self.shape, self.radius, self.object_height)

    @cached_property
    def object_shape(self) -> Shape:
        """The shape of the real object."""
        return make_shape(self.shape, self.object_radius, self.object_height)

    def rings_across(self, mesh_height: float, height: float) -> float:
        """Rings that cross the real object seen from a camera height [m], in a mesh made for `mesh_height` [m]."""
        return self.model.rings_across(self.mesh_shape, mesh_height, self.intersections, self.object_shape, height)

    def as_json(self) -> str:
        """The manifest as the model file holds it."""
        data = asdict(replace(self, look=None, upright_looks=())) | {"format_version": FORMAT_VERSION}
        data["look"] = self.look.as_dict() if self.look else None
        data["upright_looks"] = [each.as_dict() for each in self.upright_looks]
        data["self_test"] = None if self.self_test is None else self.self_test.as_dict()
        if not self.peaks:
            del data["peaks"]
        return json.dumps(data, sort_keys=True, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Manifest:
        """The manifest of a model file. Raises ModelError naming what is missing, unknown or of another version."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ModelError(f"the model's manifest is not JSON: {error}") from error
        if not isinstance(data, dict):
            raise ModelError("the model's manifest is not a JSON object")
        version = data.pop("format_version", None)
        if version != FORMAT_VERSION:
            raise ModelError(
                f"the model's manifest has format version {version!r}, this release reads version {FORMAT_VERSION}: "
                "export the model again with this release"
            )
        known = [each.name for each in fields(cls)]
        for key in data:
            if key not in known:
                raise ModelError(unknown("entry in the model's manifest", key, known))
        data.setdefault("peaks", [])  # of a network without any
        missing = [name for name in known if name not in data]
        if missing:
            raise ModelError(f"the model's manifest lacks {', '.join(missing)}")
        try:
            data["classes"] = tuple(ObjectClass(each["name"], each["kind"]) for each in data["classes"])
            data["provenance"] = {str(key): str(value) for key, value in data["provenance"].items()}
        except (TypeError, KeyError, AttributeError) as error:
            raise ModelError(f"the model's manifest has malformed classes or provenance: {error}") from error
        if data["look"] is not None:
            data["look"] = LookContract.from_dict(data["look"])
        if not isinstance(data["upright_looks"], list):
            raise ModelError(f"upright_looks in the model's manifest must be a list, not {data['upright_looks']!r}")
        data["upright_looks"] = tuple(map(LookContract.from_dict, data["upright_looks"]))
        if not isinstance(data["peaks"], list):
            raise ModelError(f"peaks in the model's manifest must be a list, not {data['peaks']!r}")
        data["peaks"] = tuple(data["peaks"])
        if data["self_test"] is not None:
            data["self_test"] = SelfTest.from_dict(data["self_test"])
        return cls(**data)
