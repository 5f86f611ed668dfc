"""The training of a mesh network: its pictures, and the files of its folder.

train.toml: the configuration. pictures.json: the split of the pictures. run.json: where the pictures are, and the
numbers of points of each class. start.pt or start.onnx: a copy of the network of --from. unpacked/: a cache of decoded
pictures, during the training. state.pt: the state to resume from. log.jsonl and tensorboard/: the record of each step.
round1.pt, ...: the best network of each round. model.pt: the best network of all rounds, for vm-evaluate and vm-export.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vm_embedded import __version__
from vm_embedded.arrays import Floats
from vm_embedded.borders.text import printable
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes, write_file
from vm_embedded.output.result_files import make_folder

from ..data.decoded_cache import DecodedCache
from ..data.pictures import find_pictures
from ..data.split import Split, read_split, write_split
from ..graphs.graph_cache import GraphCache
from ..graphs.graph_recipe import GraphRecipe
from ..graphs.loading import PictureGraphs
from ..graphs.schedule import Batch, Item, schedule
from ..runs.run import Run, check_unused, description, write_run
from .configuration import TrainConfiguration
from .selection import class_weights, selection_shares
from .start import Start

_STARTS = {".pt": "start.pt", ".onnx": "start.onnx"}
"""Copies of the network to begin with, by the suffix of its file."""

FILES = ("train.toml", *_STARTS.values(), "model.pt", "round1.pt")
"""Files that a new training would overwrite, besides those of all trainings."""

_COUNTED = 300
"""Pictures whose points are counted by class."""


@dataclass(frozen=True)
class MeshRun(Run):
    """A training as its folder describes it; `begin_run` and `read_run` make it.

    split: numbers of the pictures of each part. data: folder of the pictures. unpacked: folder for decoded pictures and
    views, None for no cache. counts (C,): number of points of each class in `counted` pictures. start: the network that
    each round begins with; None: random weights.
    """

    split: Split
    data: Path
    configuration: TrainConfiguration
    unpacked: Path | None = None
    counts: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    start: Start | None = None

    @property
    def result_path(self) -> Path:
        """File of the best network."""
        return self.folder / "model.pt"

    def round_path(self, training_round: int) -> Path:
        """File of the best network of a round, counted from 1."""
        return self.folder / f"round{training_round}.pt"

    @property
    def counted(self) -> int:
        """Number of training pictures whose points are counted."""
        return min(_COUNTED, len(self.split.training))

    def shares_and_weights(self, training_round: int) -> tuple[Floats, Floats]:
        """Chance of selection (C,) and weight (C,) of each class's points in a round, counted from 1."""
        recipe = self.configuration.training
        rule = recipe.selection_of(training_round)
        return selection_shares(rule, self.counts, self._objects), class_weights(rule, self.counts, recipe.balance)

    @property
    def selected_points_per_picture(self) -> float:
        """Expected number of points of a training picture that give gradients, by the recipe's own rule of selection
        (the first round may have another one)."""
        shares = selection_shares(self.configuration.training.selection, self.counts, self._objects)
        return float(shares @ self.counts) / self.counted

    @property
    def _objects(self) -> npt.NDArray[np.bool_]:
        """Which classes (C,) are objects."""
        return np.array([kind == "object" for kind in self.configuration.classes.kinds.values()])

    def batches(self, training_round: int) -> Iterator[Batch]:
        """All batches of a round, counted from 1: positions among the pictures for training, then for validation."""
        recipe, split = self.configuration.training, self.split
        count = len(split.training), len(split.validation)
        return schedule((recipe.seed, training_round), recipe.epochs, recipe.batch, *count, recipe.repeats)

    def graphs(self, numbers: Sequence[str] | None = None) -> PictureGraphs:
        """The graphs of some pictures; None: of those in `batches`. Raises InputError if a picture is missing."""
        wanted = (*self.split.training, *self.split.validation) if numbers is None else numbers
        found = {each.number: each for each in find_pictures(self.data)}
        missing = [number for number in wanted if number not in found]
        if missing:
            raise InputError(
                f"{len(missing)} pictures of the training are missing in {self.data}, for example {missing[0]}"
            )
        pictures, recipe = [found[number] for number in wanted], self._graph_recipe()
        if self.unpacked is None:
            return PictureGraphs(pictures, recipe)
        count = self.configuration.training.views
        views = GraphCache(self.unpacked, count, recipe) if count else None
        return PictureGraphs(pictures, recipe, DecodedCache(self.unpacked), views)

    def _graph_recipe(self) -> GraphRecipe:
        configuration = self.configuration
        return GraphRecipe(
            configuration.classes.mask_classes(),
            configuration.manifest,
            configuration.grid,
            configuration.augmentation,
            own_radius=configuration.mesh.radius_of == "scene",
            window=configuration.training.window,
            mirrored=configuration.training.mirrored,
        )

    def with_counts(self) -> MeshRun:
        """The training after counting the points of pictures spread over its folder, without augmentation.

        Raises InputError if a picture can't be read, or if there is no point.
        """
        graphs, counts = self.graphs(), np.zeros(len(self.configuration.classes.colors), dtype=np.int64)
        for position in np.linspace(0, len(self.split.training) - 1, self.counted):
            labels = graphs[Item(int(position))].labels
            counts += np.bincount(labels[labels >= 0], minlength=len(counts))
        if not counts.any():
            raise InputError(
                "no training picture has a labeled point: check that the lens files fit the pictures, and [mesh] the "
                "object (a camera below the top of a sphere or cylinder sees no point of its mesh)"
            )
        return replace(self, counts=counts)

    def provenance(self) -> dict[str, str]:
        """Where a network of this training comes from, for its manifest."""
        recipe, split = self.configuration.training, self.split
        used = hashlib.sha256(json.dumps([split.training, split.validation]).encode()).hexdigest()
        return {
            "made_by": f"vm-train {__version__}",
            "data": printable(self.data.name),
            "training_pictures": str(len(split.training)),
            "validation_pictures": str(len(split.validation)),
            "pictures_sha256": used,
            "train_toml_sha256": self.digests["train.toml"],
            "selection": recipe.selection,
            "loss": recipe.loss,
            "start_sha256": "none" if self.start is None else self.start.sha256,
            "epochs": str(recipe.epochs),
            "seed": str(recipe.seed),
        }


def begin_run(
    folder: Path,
    data: Path,
    split: Split,
    configuration: TrainConfiguration,
    *,
    unpacked: Path | None = None,
    start: Start | None = None,
    threads: int = 1,
) -> MeshRun:
    """Count the points of each class, and write the files of a new training.

    start: the network to begin with, which fits the configuration. Raises InputError, also if the folder holds a
    training.
    """
    check_unused(folder, FILES)
    run = MeshRun(folder, {}, threads, split, data.resolve(), configuration, unpacked, start=start).with_counts()
    entries = {
        "data": str(run.data),
        "unpacked": None if unpacked is None else _relative(unpacked, folder),
        "threads": threads,
        "points": dict(zip(configuration.classes.colors, run.counts.tolist(), strict=True)),
    }
    make_folder(folder)
    write_split(folder / "pictures.json", split)
    copies = [] if start is None else [_STARTS.get(start.path.suffix.lower(), "start.pt")]
    if start is not None:
        write_file(folder / copies[0], read_bytes(start.path))
    return replace(run, digests=write_run(folder, "mesh", configuration, copies, entries))


def read_run(folder: Path, moved_to: Path | None = None) -> MeshRun:
    """Read a training that was begun. moved_to: where its pictures are now.

    Raises InputError, also if its files were changed since, and ModelError.
    """
    with description(folder) as content:
        unpacked, digests = content["unpacked"], dict(content["made_from"])
        starts = [Start.load(folder / name) for name in _STARTS.values() if name in digests]
        return MeshRun(
            folder,
            digests,
            int(content["threads"]),
            read_split(folder / "pictures.json"),
            Path(content["data"]) if moved_to is None else moved_to.resolve(),
            read_sections(TrainConfiguration, folder / "train.toml"),
            None if unpacked is None else folder / unpacked,
            np.array(list(content["points"].values()), dtype=np.int64),
            starts[0] if starts else None,
        )


def _relative(unpacked: Path, folder: Path) -> str:
    """A path inside the training's folder as a relative one, so that the folder can be moved."""
    path = unpacked.resolve()
    return str(path.relative_to(folder.resolve())) if path.is_relative_to(folder.resolve()) else str(path)
