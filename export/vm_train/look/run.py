"""The training of a close look, and the files of its folder.

look.toml: the configuration. pictures.json: the split of the pictures. run.json: where the pictures are. mesh.onnx or
mesh.pt: a copy of the mesh network. patches/: the patches, in chunks. state.pt: the state to resume from. log.jsonl,
tensorboard/: the record of each step. look.pt: the network. result.json: what it finds in the validation pictures, and
how often its probabilities are right.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vm_embedded.config.sections import read_sections
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.field.features import UPRIGHTS
from vm_embedded.files import read_bytes, write_file
from vm_embedded.network.look_contract import JudgedClass, LookContract
from vm_embedded.output.result_files import make_folder

from ..data.split import Split, read_split, write_split
from ..evaluation.answers import ExactSubject, load_subject
from ..runs.run import Run, check_unused, description, write_run
from ..truth.field import CLASSES
from .configuration import LookConfiguration

_FILES = ("look.toml", "mesh.onnx", "mesh.pt", "patches", "look.pt", "result.json")
"""Files that a new training would overwrite, besides those of all trainings."""


@dataclass(frozen=True)
class LookRun(Run):
    """A training as its folder describes it; `begin_look_run` and `read_look_run` make it.

    split: numbers of the pictures of each part. data: folder of the pictures. mesh: the copy of the mesh network.
    model: that network as the user named it. classes: names of those to judge. strict: whether a picture that can't be
    used ends the training.
    """

    split: Split
    data: Path
    configuration: LookConfiguration
    mesh: Path
    model: str
    classes: tuple[str, ...]
    strict: bool

    @property
    def result_path(self) -> Path:
        """File of the trained network."""
        return self.folder / "look.pt"

    @property
    def patches(self) -> Path:
        """Folder of the patches."""
        return self.folder / "patches"

    @property
    def numbers(self) -> list[str]:
        """Numbers of all pictures, in order."""
        return sorted([*self.split.training, *self.split.validation])

    def subject(self) -> ExactSubject:
        """The mesh network. Raises InputError or ModelError."""
        return load_mesh(self.mesh)

    @property
    def contract(self) -> LookContract:
        """The contract of the network, without provenance."""
        patches, kinds = self.configuration.patches, self.configuration.classes.kinds
        radii = {name: patches.upright_radius if kinds[name] == "upright" else 0.0 for name in self.classes}
        return LookContract(
            classes=tuple(JudgedClass(name=name, upright_radius=radius) for name, radius in radii.items()),
            size=patches.size,
            extent=patches.extent,
            max_proposals=patches.max_proposals,
            channels=self.configuration.network.channels,
        )


def begin_look_run(
    folder: Path,
    data: Path,
    split: Split,
    configuration: LookConfiguration,
    model: Path,
    name: str,
    *,
    strict: bool = False,
    threads: int = 1,
) -> LookRun:
    """Write the files of a new training. model: file of the mesh network; name: as the user named it.

    Raises InputError, also if the folder holds a training, and ModelError.
    """
    check_unused(folder, _FILES)
    classes = classes_to_judge(configuration, load_mesh(model), name)
    _ = configuration.shape(len(classes))
    make_folder(folder / "patches")
    write_split(folder / "pictures.json", split)
    mesh = f"mesh{model.suffix.lower()}"
    write_file(folder / mesh, read_bytes(model))
    entries = {
        "data": str(data.resolve()),
        "mesh": mesh,
        "model": name,
        "classes": list(classes),
        "strict": strict,
        "threads": threads,
    }
    write_run(folder, "look", configuration, (mesh,), entries)
    return read_look_run(folder)


def read_look_run(folder: Path, moved_to: Path | None = None) -> LookRun:
    """Read a training that was begun. moved_to: where its pictures are now.

    Raises InputError, also if its files were changed since.
    """
    with description(folder) as content:
        return LookRun(
            folder=folder,
            digests=dict(content["made_from"]),
            split=read_split(folder / "pictures.json"),
            threads=int(content["threads"]),
            data=Path(content["data"]) if moved_to is None else moved_to.resolve(),
            configuration=read_sections(LookConfiguration, folder / "look.toml"),
            mesh=folder / str(content["mesh"]),
            model=str(content["model"]),
            classes=tuple(map(str, content["classes"])),
            strict=bool(content["strict"]),
        )


def load_mesh(path: Path) -> ExactSubject:
    """A mesh network that can propose places. Raises InputError or ModelError."""
    subject = load_subject(path, Settings())
    assert isinstance(subject, ExactSubject)
    if not subject.manifest.peaks:
        raise InputError(
            f"{path}: a close look judges peaks, and this network has none: train one with mesh.model=octaves"
        )
    return subject


def classes_to_judge(configuration: LookConfiguration, subject: ExactSubject, model: str) -> tuple[str, ...]:
    """The classes that the look network judges: all that the mesh network has peaks for.

    Raises InputError if the masks lack one.
    """
    kinds = {each.name: each.kind for each in subject.manifest.classes}
    for name in subject.manifest.peaks:
        in_masks = [each for each, kind in configuration.classes.kinds.items() if kind == kinds[name]]
        if name not in in_masks:
            raise InputError(
                f"{model} has class {name!r}, but those of the kind {kinds[name]} in [classes] are "
                f"{', '.join(in_masks) or 'none'}: give the class and its colors in masks there"
            )
        missing = [each for each in CLASSES if each not in configuration.classes.kinds]
        if name in UPRIGHTS and missing:
            raise InputError(f"the truth about a {name} needs the classes {', '.join(missing)}: add them to [classes]")
    return subject.manifest.peaks
