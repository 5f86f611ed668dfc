"""train.toml: data, mesh, network and training, a section each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from vm_embedded.config.entries import check_entries, number, one_of, share
from vm_embedded.errors import InputError
from vm_embedded.field.uprights import KINDS
from vm_embedded.geometry.shapes import SHAPES
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.manifest import POINT_COLORS, POINT_SAMPLINGS, Manifest
from vm_export.canvas_shape import CanvasShape
from vm_export.grid import GRIDS, Grid
from vm_export.network_shape import ACTIVATIONS, NetworkShape

from ..data.class_table import ClassTable
from ..graphs.augmentation import Augmentation
from ..runs.configuration import OPTIMIZERS, SCHEDULES
from .selection import RULES

LOSSES = ("cross_entropy", "focal")
PRECISIONS = ("full", "mixed")


@dataclass(frozen=True)
class DataSettings:
    """Section [data]: the split of the pictures, if vm-train gets no lists."""

    validation: float = share(0.1, "share of pictures for validation; the best epoch is chosen with them")
    test: float = share(0.1, "share of pictures for the test with vm-evaluate; the training never sees them")
    split_seed: int = number(0, "seed of the split", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class MeshSettings:
    """Section [mesh]: the points that the network sees."""

    shape: str = one_of(tuple(SHAPES), "sphere", "shape of the objects to detect")
    radius: float = number(0.095, "radius of the object, which the mesh is built for", "m", (1e-3, 100.0))
    object_height: float = number(0.0, "height of a cylinder; 0 for other shapes", "m", (0.0, 100.0))
    radius_of: str = one_of(
        ("all", "scene"),
        "all",
        "radius of the mesh; all: `radius` for every picture; scene: the radius of each picture's ball, from the "
        "sceneX.json of vm-synth; the network then suits balls of any size",
    )
    intersections: float = number(4.0, "rings of points across an object (the paper's k)", "", (0.1, 100.0))
    model: str = one_of(tuple(MESH_MODELS), "ring6", "arrangement of points and neighbors (docs/meshes.md)")
    sampling: str = one_of(
        POINT_SAMPLINGS,
        "footprint",
        "color of a point; bilinear: interpolated from four pixels; footprint: mean of the area that it covers",
    )
    colors: str = one_of(
        POINT_COLORS,
        "relative",
        "colors that the network gets; absolute: as sampled; relative: mean of the picture's points subtracted, then "
        "divided by their standard deviation",
    )
    max_distance: float = number(10.0, "how far the mesh reaches", "m", (0.1, 1e4))
    grid: str = one_of(
        GRIDS, "visual", "points; visual: the Visual Mesh; hexagonal: the paper's baseline, which can't be exported"
    )
    equal_at: float = number(
        0.0,
        "distance at which both grids have the same number of points on an object, for example 2.5; 0: both have the "
        "same number of points in the picture",
        "m",
        (0.0, 1e3),
    )

    def __post_init__(self) -> None:
        check_entries(self)
        if self.grid == "hexagonal" and MESH_MODELS[self.model].neighbors != 6:
            raise InputError(f"a hexagonal grid needs a mesh.model with six neighbors, such as ring6, not {self.model}")


@dataclass(frozen=True)
class NetworkSettings:
    """Section [network]: the layers of the network."""

    depth: int = number(
        9, "number of graph convolutions; of mesh octaves: separable convolutions at full resolution", "", (1, 100)
    )
    width: int = number(
        8, "channels of each convolution; of mesh octaves: at full resolution, a multiple of 8", "", (1, 1024)
    )
    activation: str = one_of(tuple(ACTIVATIONS), "selu", "activation after each convolution; the paper found selu best")
    kind: str = one_of(("convolution", "separable"), "convolution", "kind of convolution; separable has fewer weights")

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Recipe:
    """Section [training]. Raises InputError."""

    epochs: int = number(20, "epochs of each round; the network is validated after each epoch", "", (1, 1e6))
    repeats: int = number(1, "number of times that an epoch uses each picture", "", (1, 1e6))
    batch: int = number(8, "pictures in a step, over all processes", "", (1, 1e5))
    window: float = number(
        1.0,
        "train on random windows with this share of the picture's width and height; in pictures with objects, most "
        "windows contain an object; 1: train on whole pictures",
        "",
        (0.05, 1.0),
    )
    mirrored: float = number(0.0, "share of the training examples that are mirror images", "", (0.0, 1.0))
    views: int = number(
        0,
        "number of augmented versions of each picture to cache on disk (camera pose, lens and sharpness differ); makes "
        "epochs faster; 0: no cache",
        "",
        (0, 1e4),
    )
    rate: float = number(0.01, "highest learning rate; vm-train rate proposes one", "", (1e-9, 1e3))
    optimizer: str = one_of(
        OPTIMIZERS,
        "adamw",
        "optimizer; sgd has momentum; muon suits short trainings, with a rate of 0.006 to 0.02",
    )
    schedule: str = one_of(
        SCHEDULES,
        "one_cycle",
        "learning rate over time; one_cycle: it rises once, then falls; constant: it stays the same",
    )
    decay: float = number(1e-4, "weight decay", "", (0.0, 1.0))
    clip: float = number(1.0, "largest norm of a step's gradient; 0: no limit", "", (0.0, 1e9))
    loss: str = one_of(LOSSES, "cross_entropy", "loss of a point; focal: confident points have less weight")
    gamma: float = number(2.0, "exponent of the focal loss", "", (0.0, 20.0))
    selection: str = one_of(
        RULES,
        "weighted",
        "points that give gradients; all: every labeled point; weighted: every labeled point, with less weight for "
        "frequent classes; balanced: the same number of each class, namely that of the rarest class of kind object; "
        "hard: balanced, preferring points with large errors in earlier rounds",
    )
    balance: float = number(
        0.3,
        "class weights for selection weighted; 0: all points have equal weight; 1: all classes have equal total weight",
        "",
        (0.0, 1.0),
    )
    # "This resampling was run twice" (paper: section "Training"): three rounds.
    rounds: int = number(3, "for selection hard: networks to train one after the other", "", (2, 10))
    patience: int = number(
        0, "a round ends after this many epochs without a better validation AP; 0: it never ends early", "", (0, 1e6)
    )
    precision: str = one_of(PRECISIONS, "full", "arithmetic; mixed: bfloat16 where that is safe; faster on a GPU")
    seed: int = number(0, "seed of weights, order, point selection and augmentation", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)

    @property
    def trainings(self) -> int:
        """Number of networks that are trained one after the other."""
        return self.rounds if self.selection == "hard" else 1

    def selection_of(self, training_round: int) -> str:
        """Rule of a round, counted from 1. The first round of "hard" is "balanced": it has no earlier network."""
        return "balanced" if self.selection == "hard" and training_round == 1 else self.selection


@dataclass(frozen=True)
class TrainConfiguration:
    """All sections."""

    data: DataSettings = dataclasses.field(default_factory=DataSettings)
    classes: ClassTable = dataclasses.field(
        default_factory=ClassTable.default,
        metadata={"read": ClassTable.from_table, "to_commented_toml": ClassTable.to_commented_toml},
    )
    mesh: MeshSettings = dataclasses.field(default_factory=MeshSettings)
    network: NetworkSettings = dataclasses.field(default_factory=NetworkSettings)
    training: Recipe = dataclasses.field(default_factory=Recipe)
    augmentation: Augmentation = dataclasses.field(default_factory=Augmentation)

    def __post_init__(self) -> None:
        if self.mesh.model == "octaves":
            self._check_octaves()

    def _check_octaves(self) -> None:
        """Raise InputError for entries that a network on octaves can't have."""
        network, usual = self.network, NetworkSettings()
        for name in ("activation", "kind"):
            if getattr(network, name) != getattr(usual, name):
                raise InputError(f"{name} of [network] has no effect for mesh octaves; remove the entry")
        CanvasShape(network.depth, network.width, len(self.classes.colors), len(self._peaks))

    @property
    def _peaks(self) -> tuple[str, ...]:
        """The classes whose objects a network on octaves finds by peaks."""
        if self.mesh.model != "octaves":
            return ()
        return tuple(each.name for each in self.classes.outputs if each.kind == "object" or each.name in KINDS)

    @property
    def manifest(self) -> Manifest:
        """The manifest of this training's model files, without provenance."""
        mesh = self.mesh
        return Manifest(
            shape=mesh.shape,
            radius=mesh.radius,
            object_radius=mesh.radius,
            object_height=mesh.object_height,
            intersections=mesh.intersections,
            mesh=mesh.model,
            max_distance=mesh.max_distance,
            edge="hard",
            classes=self.classes.outputs,
            any_radius=mesh.radius_of == "scene",
            sampling=mesh.sampling,
            colors=mesh.colors,
            layout="canvas" if mesh.model == "octaves" else "plain",
            peaks=self._peaks,
        )

    @property
    def peak_numbers(self) -> tuple[int, ...]:
        """The numbers of the classes with peaks."""
        return tuple(self.manifest.column(each) for each in self._peaks)

    @property
    def grid(self) -> Grid:
        """The points that the network is trained on."""
        return Grid(self.mesh.grid, self.mesh.equal_at if self.mesh.grid == "hexagonal" else 0.0)

    @property
    def network_shape(self) -> NetworkShape | CanvasShape:
        """The layers of the network."""
        network = self.network
        if self.mesh.model == "octaves":
            return CanvasShape(network.depth, network.width, len(self.classes.colors), len(self._peaks))
        return NetworkShape.uniform(
            network.depth,
            network.width,
            len(self.classes.colors),
            network.activation,
            kind=network.kind,
            neighbors=MESH_MODELS[self.mesh.model].neighbors,
        )
