"""The folder of a fine-tuning: what it was begun with, and what it has produced.

tune.toml: the configuration. run.json: where the boxes are. before.onnx: the model file that it began with.
rendered.npz: rendered patches. patches/: patches of the user's frames. look.pt: the network, when it is trained.
state.pt: the state to resume from. log.jsonl, tensorboard/: the record of each step. model.onnx: the new model file.
pictures.json: the frames of each part. report.html, result.json: what both networks find in the held-out frames.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vm_embedded import __version__
from vm_embedded.arrays import Floats
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError, ModelError
from vm_embedded.files import write_file
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.output.result_files import make_folder
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_weights import looks_of

from ..boxes.box import BoxedPicture, BoxedSet
from ..boxes.read import read_boxes
from ..data.split import Split, write_split
from ..learning.folder_access import check_unused, description
from .boxed_objects import all_objects, boxes_sha256, check_boxes, is_round, split_by_recording
from .candidates import search_radii
from .configuration import TuningConfiguration
from .rendered_sample import check_rendered, write_rendered_for

KIND = "tuning"

REPORT = "report.html"
"""Name of the report, the last file that a fine-tuning writes."""

_FORMAT = 3
_FILES = (
    "tune.toml",
    "before.onnx",
    "rendered.npz",
    "patches",
    "state.pt",
    "log.jsonl",
    "look.pt",
    "model.onnx",
    REPORT,
    "result.json",
    "pictures.json",
)
"""Files that a new fine-tuning would overwrite."""


@dataclass(frozen=True)
class BoxSource:
    """A folder of boxes, its format (None: the one that is there), and new names for classes of the boxes."""

    folder: Path
    format: str | None
    names: Mapping[str, str]

    def read(self) -> BoxedSet:
        """The boxes. Raises InputError."""
        return read_boxes(self.folder, self.format, self.names)


@dataclass(frozen=True)
class TuningRun:
    """A fine-tuning as its folder describes it; `begin_tuning` and `read_tuning` make it.

    boxes: where the frames are. model: the network as the user named it. before: its model file. pictures: the frames
    with their boxes. split: positions of the frames in `pictures`, as text. threads: number of computing threads; a
    resumed training takes the same.
    """

    folder: Path
    boxes: BoxSource
    model: str
    before: ModelFile
    pictures: tuple[BoxedPicture, ...]
    split: Split
    configuration: TuningConfiguration
    threads: int

    @property
    def state_path(self) -> Path:
        """File of the state to resume from."""
        return self.folder / "state.pt"

    @property
    def rendered_path(self) -> Path:
        """File of the rendered patches."""
        return self.folder / "rendered.npz"

    @property
    def split_path(self) -> Path:
        """The list of the frames of each part, for vm-evaluate --boxes --list."""
        return self.folder / "pictures.json"

    @property
    def held_out(self) -> tuple[str, ...]:
        """The frames that measure the result: those for the test, or, if there are none, those for validation."""
        return self.split.test or self.split.validation

    @property
    def model_path(self) -> Path:
        """The new model file."""
        return self.folder / "model.onnx"

    @property
    def look_path(self) -> Path:
        """File of the trained network."""
        return self.folder / "look.pt"

    @property
    def object_class(self) -> str:
        """The class that the network judges."""
        name = self.before.manifest.searched_class
        assert name is not None  # begin_tuning refuses a model file without such a look
        return name

    @property
    def is_round(self) -> bool:
        """Whether the objects look round from everywhere."""
        return is_round(self.before.manifest)

    def part(self, numbers: Sequence[str]) -> list[BoxedPicture]:
        """The frames with these positions, as text."""
        return [self.pictures[int(each)] for each in numbers]

    @property
    def radii(self) -> Floats:
        """Radii (s,) of objects to look for [px]."""
        return search_radii(all_objects(self.part(self.split.training), self.object_class, self.is_round))


def tuned_look(model: ModelFile) -> LookCheckpoint:
    """The close look at objects of a model file, which a fine-tuning changes. Raises ModelError if it has none."""
    for each in looks_of(model):
        if each.contract.object_class == model.manifest.searched_class:
            return each
    raise ModelError(f"{model.path} has no close look at objects; vm-export --look attaches one")


def begin_tuning(
    folder: Path,
    boxes: BoxSource,
    found: BoxedSet,
    configuration: TuningConfiguration,
    model: Path,
    name: str,
    rendered: Path | None = None,
    threads: int = 1,
) -> TuningRun:
    """Write the files of a new fine-tuning.

    found: what `boxes` has. model: a model file with a close look; name: as the user named it. rendered: folder of the
    training of that look; None: the patches of the package. Raises InputError, also if the folder holds a training,
    and ModelError.
    """
    check_unused(folder, _FILES)
    before = read_model(model)
    look = tuned_look(before)
    check_boxes(found, look.contract.object_class, str(boxes.folder))
    check_rendered(look.contract, rendered)
    split = _split(found.pictures, configuration)
    run = TuningRun(folder, boxes, name, before, found.pictures, split, configuration, threads)
    for_training = BoxedSet(tuple(run.part(split.training)), (), ())
    check_boxes(for_training, look.contract.object_class, f"{boxes.folder}, part for training,")
    make_folder(folder / "patches")
    write_file(folder / "before.onnx", before.content)
    write_rendered_for(run.rendered_path, rendered)
    names = [each.image.relative_to(boxes.folder).as_posix() for each in found.pictures]
    parts = (tuple(names[int(each)] for each in part) for part in (split.training, split.validation, split.test))
    write_split(run.split_path, Split(*parts))
    write_file(folder / "tune.toml", to_commented_toml(configuration))
    write_file(folder / "run.json", json.dumps(_description(run), indent=1) + "\n")
    return run


def read_tuning(folder: Path, moved_to: Path | None = None) -> TuningRun:
    """The fine-tuning of a folder. moved_to: where its boxes are now. Raises InputError or ModelError."""
    with description(folder, _FORMAT, "fine-tuning") as content:
        box_folder = Path(content["boxes"]) if moved_to is None else moved_to.resolve()
        boxes = BoxSource(box_folder, content["format_of_boxes"], dict(content["names"]))
        model, threads = str(content["model"]), int(content["threads"])
        digests = str(content["boxes_sha256"]), str(content["configuration_sha256"]), str(content["before_sha256"])
    configuration = read_sections(TuningConfiguration, folder / "tune.toml")
    pictures = boxes.read().pictures
    split = _split(pictures, configuration)
    before = read_model(folder / "before.onnx")
    run = TuningRun(folder, boxes, model, before, pictures, split, configuration, threads)
    present = boxes_sha256(pictures), _configuration_sha256(configuration), before.sha256
    for what, now, then in zip((str(boxes.folder), "tune.toml", "before.onnx"), present, digests, strict=True):
        if now != then:
            raise InputError(
                f"{what} was changed since the fine-tuning began: undo the change, or begin another one in a new folder"
            )
    return run


def _split(pictures: Sequence[BoxedPicture], configuration: TuningConfiguration) -> Split:
    data = configuration.data
    return split_by_recording(pictures, data.validation, data.test, data.split_seed)


def _description(run: TuningRun) -> dict[str, Any]:
    """The content of run.json."""
    return {
        "kind": KIND,
        "format": _FORMAT,
        "version": __version__,
        "boxes": str(run.boxes.folder),
        "format_of_boxes": run.boxes.format,
        "names": dict(run.boxes.names),
        "model": run.model,
        "threads": run.threads,
        "boxes_sha256": boxes_sha256(run.pictures),
        "configuration_sha256": _configuration_sha256(run.configuration),
        "before_sha256": run.before.sha256,
    }


def _configuration_sha256(configuration: TuningConfiguration) -> str:
    return hashlib.sha256(json.dumps(asdict(configuration)).encode()).hexdigest()
