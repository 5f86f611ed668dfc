"""The training of a close look, and the files of its folder.

look.toml: the configuration. pictures.json: the split of the pictures. run.json: where the pictures are. mesh.onnx or
mesh.pt: a copy of the mesh network. glance.pt: a copy of the glance, if there is one. start.pt: a copy of the look
network that the training begins with, if there is one. patches/: the patches, in chunks. state.pt: the state to resume
from. log.jsonl, tensorboard/: the record of each step. look.pt: the network. result.json: what it finds in the
validation pictures, and how often its probabilities are right.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from vm_embedded.config.sections import read_sections
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError, unknown
from vm_embedded.field.uprights import KINDS
from vm_embedded.files import read_bytes, write_file
from vm_embedded.network.look_contract import MOST_NETWORKS
from vm_embedded.output.result_files import make_folder
from vm_export.look_checkpoint import LookCheckpoint

from ..data.split import Split, read_split, write_split
from ..evaluation.answers import ExactSubject, load_subject
from ..runs.run import Run, check_unused, description, write_run
from ..truth.field import CLASSES
from .configuration import LookConfiguration

_GLANCE, _START = "glance.pt", "start.pt"
_FILES = ("look.toml", "mesh.onnx", "mesh.pt", _GLANCE, _START, "patches", "look.pt", "result.json")
"""Files that a new training would overwrite, besides those of all trainings."""


@dataclass(frozen=True)
class LookRun(Run):
    """A training as its folder describes it; `begin_look_run` and `read_look_run` make it.

    split: numbers of the pictures of each part. data: folder of the pictures. mesh: the copy of the mesh network.
    model: that network as the user named it. object_class: class to judge. strict: whether a picture that can't be used
    ends the training.
    """

    split: Split
    data: Path
    configuration: LookConfiguration
    mesh: Path
    model: str
    object_class: str
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

    def glance(self) -> LookCheckpoint | None:
        """The network that judges the proposals first, if there is one. Raises InputError or ModelError."""
        return LookCheckpoint.load(self.folder / _GLANCE) if _GLANCE in self.digests else None

    def start(self) -> LookCheckpoint | None:
        """The look network to begin with, if there is one. Raises InputError or ModelError."""
        return LookCheckpoint.load(self.folder / _START) if _START in self.digests else None

    def provenance(self) -> dict[str, str]:
        """What a network of this training was made from, for its contract."""
        start = {"start_sha256": self.digests[_START]} if _START in self.digests else {}
        made_from = {"mesh_sha256": self.digests[self.mesh.name], "configuration_sha256": self.digests["look.toml"]}
        return made_from | start

    @property
    def upright_radius(self) -> float:
        """Radius of the circles around bases [m]; 0 for a class of kind object."""
        return upright_radius_of(self.configuration, self.object_class)


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
    glance: LookCheckpoint | None = None,
    start: LookCheckpoint | None = None,
) -> LookRun:
    """Write the files of a new training. model: file of the mesh network; name: as the user named it. glance: network
    that goes before the new one. start: network to begin with, which fits the configuration.

    Raises InputError, also if the folder holds a training, and ModelError.
    """
    check_unused(folder, _FILES)
    _ = configuration.shape
    object_class = class_to_judge(configuration, load_mesh(model), name)
    if glance is not None:
        check_glance(glance, object_class, upright_radius_of(configuration, object_class))
    make_folder(folder / "patches")
    write_split(folder / "pictures.json", split)
    mesh = f"mesh{model.suffix.lower()}"
    write_file(folder / mesh, read_bytes(model))
    looks = {path: each for path, each in ((_GLANCE, glance), (_START, start)) if each is not None}
    for path, each in looks.items():
        each.save(folder / path)
    entries = {
        "data": str(data.resolve()),
        "mesh": mesh,
        "model": name,
        "object_class": object_class,
        "strict": strict,
        "threads": threads,
    }
    write_run(folder, "look", configuration, (mesh, *looks), entries)
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
            object_class=str(content["object_class"]),
            strict=bool(content["strict"]),
        )


def load_mesh(path: Path) -> ExactSubject:
    """A mesh network that can propose places. Raises InputError or ModelError."""
    subject = load_subject(path, Settings())
    assert isinstance(subject, ExactSubject)
    if not subject.grid.is_visual:
        raise InputError(f"{path}: a close look needs a network on the Visual Mesh, not on a {subject.grid.kind} grid")
    return subject


def class_to_judge(configuration: LookConfiguration, subject: ExactSubject, model: str) -> str:
    """The class that the look network judges. Raises InputError if model or masks do not have it."""
    kinds = {each.name: each.kind for each in subject.manifest.classes}
    objects = [name for name, kind in kinds.items() if kind == "object"]
    uprights = [name for name, kind in kinds.items() if kind == "upright" and name in KINDS]
    if not objects + uprights:
        raise InputError(f"{model} has no class of the kind object, and neither goal nor robot of the kind upright")
    name = configuration.patches.object_class or (objects + uprights)[0]
    if name not in objects + uprights:
        raise InputError(f"[patches] object_class: {unknown(f'object of {model}', name, objects + uprights)}")
    in_masks = [each for each, kind in configuration.classes.kinds.items() if kind == kinds[name]]
    if name not in in_masks:
        raise InputError(
            f"{model} has class {name!r}, but those of the kind {kinds[name]} in [classes] are "
            f"{', '.join(in_masks) or 'none'}: give the class and its colors in masks there"
        )
    missing = [each for each in CLASSES if each not in configuration.classes.kinds]
    if name in uprights and missing:
        raise InputError(f"the truth about a {name} needs the classes {', '.join(missing)}: add them to [classes]")
    return name


def upright_radius_of(configuration: LookConfiguration, object_class: str) -> float:
    """Radius of the circles around bases [m]; 0 for a class of kind object."""
    is_upright = configuration.classes.kinds[object_class] == "upright"
    return configuration.patches.upright_radius if is_upright else 0.0


def check_glance(glance: LookCheckpoint, object_class: str, upright_radius: float) -> None:
    """Raise InputError if a look network can't go before one for this class, and circles of this radius [m]."""
    contract = glance.contract
    if contract.object_class != object_class:
        raise InputError(
            f"the glance of --glance or --start judges class {contract.object_class!r}; a glance for class "
            f"{object_class!r} is needed"
        )
    if len(contract.chain) == MOST_NETWORKS:
        raise InputError(
            f"the look of --glance has {MOST_NETWORKS} networks, and the new one would be another: give one with at "
            f"most {MOST_NETWORKS - 1}"
        )
    if contract.upright_radius != upright_radius:
        raise InputError(
            f"the glance of --glance or --start has an upright_radius of {contract.upright_radius:g} m, "
            f"patches.upright_radius is {upright_radius:g} m: give both the same one"
        )
