"""The folder of a training: everything that is needed to do it, and what came of it.

train.toml: the configuration. pictures.json: which pictures are for what. run.json: the data, and the classes' numbers
of points. first.pt: the network that looks first, if the new one is for a second look. teacher.pt: the one whose
answers are learned, if there is one. state.pt: how far it is. log.jsonl and tensorboard: what happened. round1.pt, ...:
the best network of each round. model.pt: the best of all, for vm-evaluate and vm-export.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded import __version__
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write

from ..data.decoded_cache import DecodedCache
from ..data.picture_files import PictureFiles
from ..data.pictures import find_pictures
from ..data.split import Split, load, save
from ..graphs.first_look import FirstLook
from ..graphs.frozen_network import FrozenNetwork
from ..graphs.graph_cache import GraphCache
from ..graphs.loading import GraphRecipe, PictureGraphs
from ..graphs.schedule import Batch, Item, schedule
from ..graphs.streamed import StreamedGraphs, StreamedItem, StreamSource, assign_lanes
from .configuration import TrainConfiguration
from .selection import selection_shares

_COUNTED = 300  # pictures of which classes are counted

_FORMAT = 3


@dataclass(frozen=True)
class TrainingRun:
    """What is to be done. data: the pictures' folder. counts (C,): points of each class in some training pictures.

    unpacked: where decoded pictures are kept, or None. source: where training pictures are streamed from, or None if
    they are in the folder. first: the network that looks first, or None. teacher: the one whose answers are learned
    beside the labels, or None.
    """

    folder: Path
    data: Path
    configuration: TrainConfiguration
    split: Split
    counts: npt.NDArray[np.int64]
    unpacked: Path | None
    source: StreamSource | None = None
    first: FirstLook | None = None
    teacher: FrozenNetwork | None = None

    @classmethod
    def begin(
        cls,
        folder: Path,
        data: Path,
        configuration: TrainConfiguration,
        split: Split,
        unpacked: Path | None,
        source: StreamSource | None = None,
        first: Path | None = None,
        teacher: Path | None = None,
    ) -> TrainingRun:
        """Write down a new training. first, teacher: checkpoints of the networks that have a part in it.

        Raises InputError, also if its folder holds a training already.
        """
        check_unused(folder)
        looks_first = None if first is None else _first(first, configuration)
        teaches = None if teacher is None else _teacher(teacher, configuration)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"can't make folder {folder}: {error.strerror or error}") from error
        none = np.zeros(len(configuration.classes.colors), dtype=np.int64)
        job = cls(folder, data.resolve(), configuration, split, none, unpacked, source, looks_first, teaches)
        counts = job._counted()
        if not counts.any():
            raise InputError(
                "no training picture has a labeled point: do the lens files fit the pictures, and [mesh] the object? "
                "(a camera below the top of a sphere or a cylinder sees no point of its mesh)"
            )
        job = replace(job, counts=counts)
        save(folder / "pictures.json", split)
        for name, path in (("first.pt", first), ("teacher.pt", teacher)):
            if path is not None:
                with atomic_write(folder / name) as part:
                    part.write_bytes(path.read_bytes())
        _write(folder / "train.toml", to_commented_toml(configuration))
        content = {
            "format": _FORMAT,
            "version": __version__,
            "data": str(job.data),
            "unpacked": None if unpacked is None else _named(unpacked, folder),
            "configuration_sha256": job.configuration_sha256,
            "source": None if source is None else asdict(source),
            "first_sha256": None if looks_first is None else looks_first.sha256,
            "teacher_sha256": None if teaches is None else teaches.sha256,
            "points": dict(zip(configuration.classes.colors, counts.tolist(), strict=True)),
        }
        _write(folder / "run.json", json.dumps(content, indent=1) + "\n")
        return job

    @classmethod
    def read(cls, folder: Path) -> TrainingRun:
        """A training that was begun. Raises InputError."""
        path = folder / "run.json"
        try:
            content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT:
                raise InputError(f"{path} is of another release: begin the training again")
            counts = np.array(list(content["points"].values()), dtype=np.int64)
            data, kept, origin = Path(content["data"]), content["unpacked"], content["source"]
            sha256, first_sha256 = content["configuration_sha256"], content["first_sha256"]
            teacher_sha256 = content["teacher_sha256"]
            source = None if origin is None else StreamSource(**origin | {"shards": tuple(origin["shards"])})
        except OSError as error:
            raise InputError(f"{folder} holds no training: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path} is damaged: {error}") from error
        configuration = read_sections(TrainConfiguration, folder / "train.toml")
        unpacked = None if kept is None else folder / kept
        first = None if first_sha256 is None else _first(folder / "first.pt", configuration)
        teacher = None if teacher_sha256 is None else _teacher(folder / "teacher.pt", configuration)
        job = cls(folder, data, configuration, load(folder / "pictures.json"), counts, unpacked, source, first, teacher)
        for name, part, before in (("first.pt", first, first_sha256), ("teacher.pt", teacher, teacher_sha256)):
            if part is not None and part.sha256 != before:
                raise InputError(f"{folder / name} was changed since the training began: begin another one")
        if job.configuration_sha256 != sha256:
            raise InputError(
                f"{folder / 'train.toml'} or pictures.json was changed since the training began: "
                "undo that, or begin another one in a new folder"
            )
        return job

    @property
    def configuration_sha256(self) -> str:
        """Digest of the configuration and of which pictures are for what."""
        text = json.dumps([asdict(self.configuration), asdict(self.split)])
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def objects(self) -> npt.NDArray[np.bool_]:
        """Which classes (C,) are objects."""
        return np.array([kind == "object" for kind in self.configuration.classes.kinds.values()])

    @property
    def points_a_picture(self) -> float:
        """How many points of a training picture are about to give gradients."""
        shares = selection_shares(self.configuration.training.selection, self.counts, self.objects)
        return float(shares @ self.counts) / min(_COUNTED, self.epoch)

    @property
    def epoch(self) -> int:
        """Training pictures in an epoch."""
        return len(self.split.training) if self.source is None else self.source.epoch

    def batches(self, training_round: int) -> Iterator[Batch]:
        """All batches of a round, counted from 1."""
        recipe = self.configuration.training
        seed = (recipe.seed, training_round)
        validation = len(self.split.validation)
        batches = schedule(seed, recipe.epochs, recipe.batch, self.epoch, validation, recipe.looks)
        return batches if self.source is None else assign_lanes(batches, seed, self.source)

    def scheduled(self) -> PictureGraphs | StreamedGraphs:
        """The graphs of what is in batches. Raises InputError if a picture of the folder is not there any more."""
        graphs = self.graphs((*self.split.training, *self.split.validation))
        return graphs if self.source is None else StreamedGraphs(self.source, graphs)

    def _counted(self) -> npt.NDArray[np.int64]:
        """Points (C,) of each class in some training pictures as they are, of a stream in the first ones of a lane."""
        number = min(_COUNTED, self.epoch)
        if self.source is None:
            items = [Item(int(each)) for each in np.linspace(0, self.epoch - 1, number)]
        else:
            order = (self.configuration.training.seed, 0)
            items = [StreamedItem(0, None, order, 0, place) for place in range(number)]
        graphs = self.scheduled()
        counts = np.zeros_like(self.counts)
        for item in items:
            labels = graphs[item].labels
            counts += np.bincount(labels[labels >= 0], minlength=len(counts))
        return counts

    def graphs(self, numbers: Sequence[str]) -> PictureGraphs:
        """The graphs of some pictures. Raises InputError if one is not there any more."""
        found = {each.number: each for each in find_pictures(self.data)}
        missing = [number for number in numbers if number not in found]
        if missing:
            raise InputError(f"{len(missing)} pictures of the training are not in {self.data}, as {missing[0]}")
        pictures: list[PictureFiles] = [found[number] for number in numbers]
        mesh = self.configuration.mesh
        view = GraphRecipe(
            self.configuration.classes.mask_classes(),
            self.configuration.manifest,
            self.configuration.grid,
            self.configuration.augmentation,
            mesh.radius_of == "scene",
            self.configuration.training.window,
            self.first,
            self.configuration.training.mirrored,
        )
        if self.unpacked is None:
            return PictureGraphs(pictures, view)
        count = self.configuration.training.views
        views = GraphCache(
            self.unpacked, count, view.classes, view.manifest, view.grid, view.augmentation, view.own_radius
        )
        return PictureGraphs(pictures, view, DecodedCache(self.unpacked), views if count else None)

    def round_path(self, training_round: int) -> Path:
        """The best network of a round, counted from 1."""
        return self.folder / f"round{training_round}.pt"

    @property
    def state_path(self) -> Path:
        """How far the training is."""
        return self.folder / "state.pt"

    @property
    def model_path(self) -> Path:
        """The best network."""
        return self.folder / "model.pt"

    def provenance(self) -> dict[str, str]:
        """Where a network of this training comes from, for its manifest."""
        recipe, split = self.configuration.training, self.split
        training = split.training if self.source is None else self.source.shards
        used = hashlib.sha256(json.dumps([training, split.validation]).encode()).hexdigest()
        return {
            "made_by": f"vm-train {__version__}",
            "data": self.data.name,
            "training_pictures": str(self.epoch) if self.source is None else f"{self.epoch} an epoch, streamed",
            "validation_pictures": str(len(split.validation)),
            "pictures_sha256": used,
            "configuration_sha256": self.configuration_sha256,
            "selection": recipe.selection,
            "loss": recipe.loss,
            "teacher_sha256": "none" if self.teacher is None else self.teacher.sha256,
            "epochs": str(recipe.epochs),
            "seed": str(recipe.seed),
        }


_FILES = ("train.toml", "pictures.json", "first.pt", "teacher.pt", "state.pt", "model.pt", "round1.pt", "log.jsonl")


def check_unused(folder: Path) -> None:
    """Raise InputError if a folder holds a training, or files that one would write over."""
    if (folder / "run.json").exists():
        raise InputError(f"{folder} holds a training already: vm-train resume {folder}, or another folder")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is no folder")
    there = [name for name in _FILES if (folder / name).exists()]
    if there:
        raise InputError(f"{folder} holds {', '.join(there)}, which a training would write over: give a new folder")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from going on with the same training. Raises InputError if one does."""
    with (folder / "run.json").open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(f"another process is training in {folder}") from error
        yield


def _first(path: Path, configuration: TrainConfiguration) -> FirstLook:
    gate = configuration.second_look
    return FirstLook.load(path, configuration.manifest, gate.above, gate.rings)


def _teacher(path: Path, configuration: TrainConfiguration) -> FrozenNetwork:
    return FrozenNetwork.load(path, configuration.manifest, configuration.grid)


def _named(unpacked: Path, folder: Path) -> str:
    """Relative to the training's folder if it is in it, so that it may be moved."""
    path = unpacked.resolve()
    return str(path.relative_to(folder.resolve())) if path.is_relative_to(folder.resolve()) else str(path)


def _write(path: Path, text: str) -> None:
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")
