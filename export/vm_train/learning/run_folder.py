"""The folder of a training: what it was begun with, and what it has produced.

train.toml: the configuration. pictures.json: the split of the pictures. run.json: where the pictures are, and the
numbers of points of each class. start.pt or start.onnx: a copy of the network of --from. unpacked/: a cache of decoded
pictures, during the training. state.pt: the state to resume from. log.jsonl and tensorboard/: the record of each step.
round1.pt, ...: the best network of each round. model.pt: the best network of all rounds, for vm-evaluate and vm-export.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded import __version__
from vm_embedded.arrays import Floats
from vm_embedded.borders.text import printable
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes, write_file
from vm_embedded.output.result_files import make_folder

from ..data.split import read_split, write_split
from ..graphs.loading import PictureGraphs
from .configuration import TrainConfiguration
from .folder_access import check_unused, description
from .selection import class_weights, selection_shares
from .start import Start
from .training_data import TrainingData

_FORMAT = 6
_STARTS = {".pt": "start.pt", ".onnx": "start.onnx"}
"""Copies of the network to begin with, by the suffix of its file."""

FILES = ("train.toml", "pictures.json", *_STARTS.values(), "state.pt", "model.pt", "round1.pt", "log.jsonl")
"""Files that a new training would overwrite, besides run.json."""


@dataclass(frozen=True)
class TrainingRun:
    """A training as its folder describes it; `begin_run` and `read_run` make it.

    counts (C,): number of points of each class in as many pictures as `data.counted` says. start: the network that each
    round begins with; None: random weights.
    """

    folder: Path
    data: TrainingData
    configuration: TrainConfiguration
    counts: npt.NDArray[np.int64]
    start: Start | None = None

    @property
    def state_path(self) -> Path:
        """File of the state to resume from."""
        return self.folder / "state.pt"

    @property
    def model_path(self) -> Path:
        """File of the best network."""
        return self.folder / "model.pt"

    def round_path(self, training_round: int) -> Path:
        """File of the best network of a round, counted from 1."""
        return self.folder / f"round{training_round}.pt"

    @property
    def configuration_sha256(self) -> str:
        """Digest of configuration and split.

        The digest also covers the split, although its name does not say so: run.json and model files use the name.
        """
        text = json.dumps([asdict(self.configuration), asdict(self.data.split)])
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def objects(self) -> npt.NDArray[np.bool_]:
        """Which classes (C,) are objects."""
        return np.array([kind == "object" for kind in self.configuration.classes.kinds.values()])

    def shares_and_weights(self, training_round: int) -> tuple[Floats, Floats]:
        """Chance of selection (C,) and weight (C,) of each class's points in a round, counted from 1."""
        recipe = self.configuration.training
        rule = recipe.selection_of(training_round)
        return selection_shares(rule, self.counts, self.objects), class_weights(rule, self.counts, recipe.balance)

    @property
    def selected_points_per_picture(self) -> float:
        """Expected number of points of a training picture that give gradients, by the recipe's own rule of selection
        (the first round may have another one)."""
        shares = selection_shares(self.configuration.training.selection, self.counts, self.objects)
        return float(shares @ self.counts) / self.data.counted

    def scheduled_graphs(self) -> PictureGraphs:
        """The graphs of the training's batches. Raises InputError if a picture is missing."""
        return self.data.scheduled_graphs(self.configuration)

    def graphs(self, numbers: Sequence[str]) -> PictureGraphs:
        """The graphs of some pictures of the folder. Raises InputError if a picture is missing."""
        return self.data.graphs(numbers, self.configuration)

    def provenance(self) -> dict[str, str]:
        """Where a network of this training comes from, for its manifest."""
        recipe, data = self.configuration.training, self.data
        used = hashlib.sha256(json.dumps([data.split.training, data.split.validation]).encode()).hexdigest()
        return {
            "made_by": f"vm-train {__version__}",
            "data": printable(data.folder.name),
            "training_pictures": str(data.pictures_per_epoch),
            "validation_pictures": str(len(data.split.validation)),
            "pictures_sha256": used,
            "configuration_sha256": self.configuration_sha256,
            "selection": recipe.selection,
            "loss": recipe.loss,
            "start_sha256": "none" if self.start is None else self.start.sha256,
            "epochs": str(recipe.epochs),
            "seed": str(recipe.seed),
        }


def begin_run(
    folder: Path,
    data: TrainingData,
    configuration: TrainConfiguration,
    start: Start | None = None,
) -> TrainingRun:
    """Count the points of each class, and write the files of a new training.

    start: the network to begin with, which fits the configuration. Raises InputError, also if the folder holds a
    training.
    """
    check_unused(folder, FILES)
    data = replace(data, folder=data.folder.resolve())
    make_folder(folder)
    counts = data.count_points(configuration)
    if not counts.any():
        raise InputError(
            "no training picture has a labeled point: check that the lens files fit the pictures, and [mesh] the "
            "object (a camera below the top of a sphere or cylinder sees no point of its mesh)"
        )
    run = TrainingRun(folder, data, configuration, counts, start)
    write_split(folder / "pictures.json", data.split)
    if start is not None:
        write_file(folder / _start_name(start), read_bytes(start.path))
    write_file(folder / "train.toml", to_commented_toml(configuration))
    write_file(folder / "run.json", json.dumps(_description(run), indent=1) + "\n")
    return run


def read_run(folder: Path) -> TrainingRun:
    """Read a training that was begun. Raises InputError, also if its files were changed since."""
    with description(folder, _FORMAT) as content:
        counts = np.array(list(content["points"].values()), dtype=np.int64)
        pictures, unpacked = Path(content["data"]), content["unpacked"]
        configuration_sha256 = content["configuration_sha256"]
        started = content["start"]
        start_name, start_sha256 = (None, None) if started is None else (str(started["file"]), started["sha256"])
    configuration = read_sections(TrainConfiguration, folder / "train.toml")
    start = None if start_name is None else Start.load(folder / start_name)
    split = read_split(folder / "pictures.json")
    data = TrainingData(pictures, split, None if unpacked is None else folder / unpacked)
    run = TrainingRun(folder, data, configuration, counts, start)
    if start is not None and start.sha256 != start_sha256:
        raise InputError(f"{start.path} was changed since the training began: begin another one")
    if run.configuration_sha256 != configuration_sha256:
        raise InputError(
            f"{folder / 'train.toml'} or pictures.json was changed since the training began: "
            "undo the change, or begin another training in a new folder"
        )
    return run


def _description(run: TrainingRun) -> dict[str, Any]:
    """The content of run.json."""
    data, names = run.data, run.configuration.classes.colors
    return {
        "format": _FORMAT,
        "version": __version__,
        "data": str(data.folder),
        "unpacked": None if data.unpacked is None else _relative(data.unpacked, run.folder),
        "configuration_sha256": run.configuration_sha256,
        "start": None if run.start is None else {"file": _start_name(run.start), "sha256": run.start.sha256},
        "points": dict(zip(names, run.counts.tolist(), strict=True)),
    }


def _start_name(start: Start) -> str:
    return _STARTS.get(start.path.suffix.lower(), "start.pt")


def _relative(unpacked: Path, folder: Path) -> str:
    """A path inside the training's folder as a relative one, so that the folder can be moved."""
    path = unpacked.resolve()
    return str(path.relative_to(folder.resolve())) if path.is_relative_to(folder.resolve()) else str(path)
