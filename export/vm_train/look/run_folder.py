"""The folder of a training of a close look: what it was begun with, and what it has produced.

look.toml: the configuration. pictures.json: the split of the pictures. run.json: where the pictures are. mesh.onnx or
mesh.pt: a copy of the mesh network. start.pt: a copy of the look
network that the training begins with, if there is one. patches/: the patches, in chunks. state.pt: the state to resume
from. log.jsonl, tensorboard/: the record of each step. look.pt: the network. result.json: what it finds in the
validation pictures, and how often its probabilities are right.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vm_embedded import __version__
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes, write_file
from vm_embedded.output.result_files import make_folder
from vm_export.look_checkpoint import LookCheckpoint

from ..data.split import Split, read_split, write_split
from ..evaluation.answers import ExactSubject
from ..learning.folder_access import check_unused, description
from .configuration import LookConfiguration
from .judged import judged_class, load_mesh, upright_radius_of

KIND = "look"
_FORMAT = 5
_START = "start.pt"
_FILES = (
    "look.toml",
    "pictures.json",
    "mesh.onnx",
    "mesh.pt",
    _START,
    "patches",
    "state.pt",
    "log.jsonl",
    "look.pt",
    "result.json",
)
"""Files that a new training would overwrite."""


@dataclass(frozen=True)
class LookRun:
    """A training as its folder describes it; `begin_look_run` and `read_look_run` make it.

    data: folder of the pictures. model: the mesh network as the user named it. mesh: its copy. start_sha256: digest of
    the checkpoint of the network to begin with, None without one. object_class: class to judge. strict: whether a
    picture that can't be used ends the training. threads: number of computing threads; a resumed training takes the
    same.
    """

    folder: Path
    data: Path
    split: Split
    configuration: LookConfiguration
    model: str
    mesh: Path
    mesh_sha256: str
    start_sha256: str | None
    object_class: str
    strict: bool
    threads: int

    @property
    def state_path(self) -> Path:
        """File of the state to resume from."""
        return self.folder / "state.pt"

    @property
    def look_path(self) -> Path:
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

    @property
    def configuration_sha256(self) -> str:
        """Digest of the configuration, the split, the mesh network and the network to begin with."""
        networks = self.mesh_sha256, self.start_sha256
        text = json.dumps([asdict(self.configuration), asdict(self.split), *networks])
        return hashlib.sha256(text.encode()).hexdigest()

    def subject(self) -> ExactSubject:
        """The mesh network. Raises InputError or ModelError."""
        return load_mesh(self.mesh)

    def start(self) -> LookCheckpoint | None:
        """The look network to begin with, if there is one. Raises InputError or ModelError."""
        return None if self.start_sha256 is None else LookCheckpoint.load(self.folder / _START)

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
    start: LookCheckpoint | None = None,
) -> LookRun:
    """Write the files of a new training. model: file of the mesh network; name: as the user named it. start: network to
    begin with, which fits the configuration.

    Raises InputError, also if the folder holds a training, and ModelError.
    """
    check_unused(folder, _FILES)
    _ = configuration.shape
    subject = load_mesh(model)
    object_class = judged_class(configuration, subject, name)
    make_folder(folder / "patches")
    mesh = folder / f"mesh{model.suffix.lower()}"
    write_file(mesh, read_bytes(model))
    run = LookRun(
        folder=folder,
        data=data.resolve(),
        split=split,
        configuration=configuration,
        model=name,
        mesh=mesh,
        mesh_sha256=subject.sha256,
        start_sha256=_saved(start, folder / _START),
        object_class=object_class,
        strict=strict,
        threads=threads,
    )
    write_split(folder / "pictures.json", split)
    write_file(folder / "look.toml", to_commented_toml(configuration))
    write_file(folder / "run.json", json.dumps(_description(run), indent=1) + "\n")
    return run


def read_look_run(folder: Path) -> LookRun:
    """Read a training that was begun. Raises InputError, also if its files were changed since, and ModelError."""
    with description(folder, _FORMAT) as content:
        run = LookRun(
            folder=folder,
            data=Path(content["data"]),
            split=read_split(folder / "pictures.json"),
            configuration=read_sections(LookConfiguration, folder / "look.toml"),
            model=str(content["model"]),
            mesh=folder / str(content["mesh"]),
            mesh_sha256=str(content["mesh_sha256"]),
            start_sha256=None if content["start_sha256"] is None else str(content["start_sha256"]),
            object_class=str(content["object_class"]),
            strict=bool(content["strict"]),
            threads=int(content["threads"]),
        )
        configuration_sha256 = content["configuration_sha256"]
    if run.configuration_sha256 != configuration_sha256:
        raise InputError(
            f"{folder / 'look.toml'} or pictures.json was changed since the training began: "
            "undo the change, or begin another training in a new folder"
        )
    if run.subject().sha256 != run.mesh_sha256:
        raise InputError(f"{run.mesh} was changed since the training began: begin another one")
    if run.start_sha256 is not None and _sha256(folder / _START) != run.start_sha256:
        raise InputError(f"{folder / _START} was changed since the training began: begin another one")
    return run


def _description(run: LookRun) -> dict[str, Any]:
    """The content of run.json."""
    return {
        "kind": KIND,
        "format": _FORMAT,
        "version": __version__,
        "data": str(run.data),
        "model": run.model,
        "mesh": run.mesh.name,
        "mesh_sha256": run.mesh_sha256,
        "start_sha256": run.start_sha256,
        "object_class": run.object_class,
        "strict": run.strict,
        "threads": run.threads,
        "configuration_sha256": run.configuration_sha256,
    }


def _saved(look: LookCheckpoint | None, path: Path) -> str | None:
    """Write a look network, if there is one, and return the digest of its file."""
    if look is None:
        return None
    look.save(path)
    return _sha256(path)


def _sha256(path: Path) -> str:
    return hashlib.sha256(read_bytes(path)).hexdigest()
