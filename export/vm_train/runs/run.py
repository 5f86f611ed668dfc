"""The folder of a training: what it was made from, its state, and who writes to it.

run.json: the kind of training, the SHA-256 of each file that it was made from, and what else its kind remembers. Nobody
may change these files before its end. state.pt: the state to resume from. Each kind adds its own files.
"""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vm_embedded import __version__
from vm_embedded.config.toml_writer import to_commented_toml
from vm_embedded.errors import InputError, unknown
from vm_embedded.files import locked_folder, read_bytes, read_regular, write_file
from vm_embedded.output.result_files import make_folder

from .configuration import KINDS, configuration_name

_FORMAT = 7


@dataclass(frozen=True)
class Run(ABC):
    """A training as its folder describes it.

    digests: SHA-256 of the files that it was made from, by name. threads: number of computing threads; a resumed
    training takes the same.
    """

    folder: Path
    digests: Mapping[str, str]
    threads: int

    @property
    def state_path(self) -> Path:
        """File of the state to resume from."""
        return self.folder / "state.pt"

    @property
    @abstractmethod
    def result_path(self) -> Path:
        """File that the training makes."""


def check_unused(folder: Path, names: Sequence[str]) -> None:
    """Raise InputError if a folder holds a training, or one of the files `names`, which a new one would overwrite."""
    if (folder / "run.json").exists():
        raise InputError(f"{folder} holds a training already: vm-train resume {folder}, or give another folder")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    present = [name for name in (*names, "pictures.json", "state.pt", "log.jsonl") if (folder / name).exists()]
    if present:
        raise InputError(f"{folder} holds {', '.join(present)}, which a training would overwrite: give a new folder")


def write_run(
    folder: Path,
    kind: str,
    configuration: Any,
    copies: Sequence[str],
    entries: Mapping[str, Any],
) -> dict[str, str]:
    """Write configuration and run.json of a training. Returns the digests of the files that it is made from.

    copies: names of further such files, which are in the folder already, beside pictures.json. entries: what else to
    keep in run.json. Raises InputError if a file can't be written.
    """
    toml = configuration_name(kind)
    write_file(folder / toml, to_commented_toml(configuration))
    digests = {name: sha256_of(folder / name) for name in (toml, "pictures.json", *copies)}
    content = {"kind": kind, "format": _FORMAT, "version": __version__, "made_from": digests, **entries}
    write_file(folder / "run.json", json.dumps(content, indent=1) + "\n")
    return digests


@contextmanager
def description(folder: Path) -> Iterator[dict[str, Any]]:
    """The content of a folder's run.json, for a with statement that takes its entries.

    Raises InputError if there is no run.json, if another release wrote it, if it is damaged, or if a file that the
    training was made from has changed. An entry that the statement does not find, or that has the wrong type, also
    counts as damage.
    """
    path = folder / "run.json"
    try:
        content = json.loads(read_regular(path))
        if content["format"] != _FORMAT:
            raise InputError(f"{path} was written by another release: begin the training again")
        for name, digest in content["made_from"].items():
            if sha256_of(folder / str(name)) != digest:
                raise InputError(
                    f"{folder / str(name)} was changed since the training began: undo the change, or begin another "
                    "training in a new folder"
                )
        yield content
    except OSError as error:
        raise InputError(f"{folder} holds no training: can't read run.json: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}") from error


def kind_of(folder: Path) -> str:
    """The kind of training in a folder, one of KINDS. Raises InputError as `description` does."""
    with description(folder) as content:
        if content["kind"] not in KINDS:
            raise ValueError(unknown("kind", content["kind"], KINDS))
        return str(content["kind"])


def sha256_of(path: Path) -> str:
    """SHA-256 of a file. Raises InputError if it can't be read."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes from training in the same folder. It is created, and then removed if it stays empty.

    The lock is that of the folder: a file in it could be replaced. Raises InputError if another process holds it.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file: give a new folder")
    is_new = not folder.exists()
    make_folder(folder)
    with ExitStack() as held:
        try:
            held.enter_context(locked_folder(folder.resolve()))
        except BlockingIOError as error:
            raise InputError(f"another process is training in {folder}") from error
        except OSError:  # a file system without locks
            pass
        try:
            yield
        finally:
            if is_new:
                with suppress(OSError):
                    folder.rmdir()
