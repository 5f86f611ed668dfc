"""The plan of a set, set.json: seed, number of pictures, configuration and maps."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes, write_file

from ..scene.configuration import SceneConfiguration
from .files import FORMAT, SET, files_in, read_table


@dataclass(frozen=True)
class Plan:
    """Defines a set: the same plan gives the same pictures.

    maps: names of the maps, each with the SHA-256 of its file. files: the same for other files of the configuration.
    """

    seed: int
    count: int
    configuration: SceneConfiguration
    maps: dict[str, str]
    files: dict[str, str] = field(default_factory=dict)

    def as_json(self) -> str:
        """The content of set.json."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1, sort_keys=True) + "\n"

    def write(self, folder: Path) -> None:
        """Write set.json. If the folder has one already, check that it is of the same set; its count may differ.

        Raises InputError that names the difference, or a picture in a folder without set.json.
        """
        path = folder / SET
        wanted = json.loads(self.as_json())
        if path.exists():
            found = read_plan(folder)
            for key in ("format", "seed", "maps", "files", "configuration"):
                if found.get(key) != wanted[key]:
                    shown = f": {found.get(key)}, not {wanted[key]}" if key in ("format", "seed") else ""
                    raise InputError(
                        f"{folder} contains a set with another {key}{shown}; continue it with the original command "
                        "or write to another folder"
                    )
            if found.get("count", 0) >= self.count:
                return
        elif others := sorted(files_in(folder)):
            raise InputError(
                f"{folder} contains {others[0].name} but no set.json, so its pictures are not from vm-synth; "
                "write to another folder"
            )
        write_file(path, self.as_json())


def read_plan(folder: Path) -> dict[str, Any]:
    """The content of a folder's set.json. Raises InputError."""
    path = folder / SET
    try:
        return read_table(path)
    except OSError as error:
        raise InputError(
            f"{folder} is not a set of vm-synth: can't read {path.name}: {error.strerror or error}"
        ) from error


def digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal. Raises InputError."""
    return hashlib.sha256(read_bytes(path)).hexdigest()


def shard_of(indices: Sequence[int], number: int, count: int) -> list[int]:
    """The indices that shard `number` (1 to count) of `count` renders."""
    return [index for index in indices if index % count == number - 1]
