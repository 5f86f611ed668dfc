"""A fine-tuning of a close look, and the files of its folder.

tune.toml: the configuration. run.json: where the boxes are. before.onnx: the model file that it began with.
rendered.npz: rendered patches. pictures.json: the frames of each part. patches/: patches of the user's frames.
look.pt: the network, when it is trained. state.pt: the state to resume from. log.jsonl, tensorboard/: the record of
each step. model.onnx: the new model file. report.html, result.json: what both networks find in the held-out frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError, ModelError
from vm_embedded.files import write_file
from vm_embedded.network.model_file import ModelFile, read_model
from vm_embedded.output.result_files import make_folder
from vm_export.look_checkpoint import LookCheckpoint
from vm_export.look_weights import look_of

from ..boxes.box import BoxedPicture, BoxedSet
from ..boxes.read import read_boxes
from ..data.split import Split, write_split
from ..look.labels import NOTHING, OBJECT
from ..look.patch_set import PatchChunk, PatchSet
from ..look.run import read_look_run
from ..runs.run import Run, check_unused, description, write_run
from .boxed_objects import all_objects, boxes_sha256, check_boxes, is_round, split_by_recording
from .candidates import search_radii
from .configuration import TuningConfiguration
from .rendered_patches import RENDERED, rendered_names, write_rendered

_FILES = (
    *("tune.toml", "before.onnx", "rendered.npz", "patches", "look.pt", "model.onnx", "report.html"),
    "result.json",
)
"""Files that a new fine-tuning would overwrite, besides those of all trainings."""


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
class TuningRun(Run):
    """A fine-tuning as its folder describes it; `begin_tuning` and `read_tuning` make it.

    split: positions of the frames in `pictures`, as text. boxes: where the frames are. configuration: its settings.
    model: the network as the user named it. before: its model file. pictures: the frames with their boxes.
    """

    split: Split
    boxes: BoxSource
    configuration: TuningConfiguration
    model: str
    before: ModelFile
    pictures: tuple[BoxedPicture, ...]

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
    def result_path(self) -> Path:
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
    """The close look of a model file, which a fine-tuning changes. Raises ModelError if it has none at objects."""
    look = look_of(model)
    if look is None or model.manifest.searched_class is None:
        raise ModelError(f"{model.path} has no close look at objects; vm-export --look attaches one")
    return look


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
    tuned_look(before)
    name_of_class, pictures = before.manifest.searched_class or "", found.pictures
    check_boxes(found, name_of_class, str(boxes.folder))
    check_rendered(name_of_class, rendered)
    run = TuningRun(folder, {}, threads, _split(pictures, configuration), boxes, configuration, name, before, pictures)
    for_training = BoxedSet(tuple(run.part(run.split.training)), (), ())
    check_boxes(for_training, run.object_class, f"{boxes.folder}, part for training,")
    make_folder(folder / "patches")
    write_file(folder / "before.onnx", before.content)
    write_rendered_for(run.rendered_path, rendered)
    names = [each.image.relative_to(boxes.folder).as_posix() for each in pictures]
    parts = (tuple(names[int(each)] for each in part) for part in vars(run.split).values())
    write_split(run.split_path, Split(*parts))
    entries = {
        "boxes": str(boxes.folder),
        "format_of_boxes": boxes.format,
        "names": dict(boxes.names),
        "model": name,
        "threads": threads,
        "boxes_sha256": boxes_sha256(pictures),
    }
    copies = ("before.onnx", "rendered.npz")
    return replace(run, digests=write_run(folder, "tune", configuration, copies, entries))


def read_tuning(folder: Path, moved_to: Path | None = None) -> TuningRun:
    """The fine-tuning of a folder. moved_to: where its boxes are now. Raises InputError or ModelError."""
    with description(folder) as content:
        box_folder = Path(content["boxes"]) if moved_to is None else moved_to.resolve()
        boxes = BoxSource(box_folder, content["format_of_boxes"], dict(content["names"]))
        configuration, pictures = read_sections(TuningConfiguration, folder / "tune.toml"), boxes.read().pictures
        if boxes_sha256(pictures) != content["boxes_sha256"]:
            raise InputError(
                f"{boxes.folder} was changed since the training began: undo the change, or begin another training in "
                "a new folder"
            )
        return TuningRun(
            folder=folder,
            digests=dict(content["made_from"]),
            split=_split(pictures, configuration),
            threads=int(content["threads"]),
            boxes=boxes,
            configuration=configuration,
            model=str(content["model"]),
            before=read_model(folder / "before.onnx"),
            pictures=pictures,
        )


def _split(pictures: Sequence[BoxedPicture], configuration: TuningConfiguration) -> Split:
    data = configuration.data
    return split_by_recording(pictures, data.validation, data.test, data.split_seed)


_COUNTS = {OBJECT: 1600, NOTHING: 2400}
"""Patches of a class with and without an object in a sample; with a quarter of them of two other classes, these are
about as many as in six pictures of patches."""

_OTHERS = 4
"""Classes after the first one have one of so many patches."""


def check_rendered(name: str, run: Path | None) -> None:
    """Raise InputError if there are no rendered patches of a class.

    run: folder of the training of the look; None: the patches of the package are to be used.
    """
    if run is None and name not in (known := rendered_names(RENDERED)):
        raise InputError(
            f"the package has rendered patches of {', '.join(known)}, but the close look judges {name!r}: give the "
            "folder of its vm-train look training with --rendered, so that the network does not forget what it has "
            "learned"
        )
    if run is not None and name not in (judged := read_look_run(run).classes):
        raise InputError(f"{run} is the training of a look at {', '.join(judged)}, not at {name!r}")


def write_rendered_for(path: Path, run: Path | None) -> None:
    """Write the rendered patches for a fine-tuning; see `check_rendered`. Raises InputError."""
    if run is not None:
        write_sample(path, run)
        return
    try:
        content = RENDERED.read_bytes()
    except OSError as error:
        raise InputError(f"can't read {RENDERED}: {error.strerror or error}") from error
    write_file(path, content)


def write_sample(path: Path, folder: Path) -> None:
    """Write a sample of the training patches of a look network, always the same. Raises InputError."""
    run = read_look_run(folder)
    paths = sorted(run.patches.glob("*.npz"))
    if not paths:
        raise InputError(f"{run.patches} has no patches")
    random = np.random.default_rng(0)
    validation = np.isin(run.numbers, run.split.validation)
    chosen = []
    for each in paths:
        patches = PatchChunk.load(each).patches
        for kind in range(len(run.classes)):
            for label, count in _COUNTS.items():
                wanted = count // _OTHERS if kind else count
                rows = (patches.labels == label) & (patches.kinds == kind) & ~validation[patches.pictures]
                kept = random.permutation(np.flatnonzero(rows))[: -(-wanted // len(paths))]
                chosen.append(patches.part(np.sort(kept)))
    write_rendered(path, PatchSet.joined(run.configuration.patches.size, chosen), run.classes)
