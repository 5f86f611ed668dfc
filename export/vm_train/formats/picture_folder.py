"""The folder of pictures that an import writes to.

A file that is there already stays, and a new one of its name must have the same bytes. So an import can be repeated
after a stop, more can be imported later, and two pictures of one number are never mixed. import.json names the archives
that were imported as a whole.
"""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes, read_regular, write_file

from ..data.decoded_cache import KEPT_FREE
from ..data.picture_files import LARGEST_FILE, PARTS, FileName, parse_name


class PictureFolder:
    """A folder of pictures, made if it is missing.

    imported: numbers of pictures with a file that this import had. remarks: lines to print at its end.

    Raises InputError if it can't be read, or if its import.json is damaged.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self.imported, self.remarks = folder, set[str](), list[str]()
        self._record = folder / "import.json"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            names = [each.name for each in folder.iterdir()]
            whole = json.loads(read_regular(self._record)) if self._record.name in names else {}
        except OSError as error:
            raise InputError(f"can't use folder {folder}: {error.strerror or error}") from error
        except (ValueError, RecursionError) as error:
            raise InputError(f"{self._record} is damaged: remove it, and repeat the import") from error
        if not isinstance(whole, dict):
            raise InputError(f"{self._record} is damaged: remove it, and repeat the import")
        self._whole: dict[str, str] = whole
        self._files: defaultdict[str, dict[str, str]] = defaultdict(dict)  # number, part, name of the file
        for name in names:
            if found := parse_name(name):
                self._files[found.number][found.part] = name

    @property
    def count(self) -> int:
        """Number of pictures with all their files."""
        return sum(all(part in files for part in PARTS) for files in self._files.values())

    def lacking(self, numbers: Iterable[str]) -> list[str]:
        """A line for each of some pictures that lacks a file."""
        missing = {each: [part for part in PARTS if part not in self._files[each]] for each in sorted(numbers)}
        return [f"picture {number}: lacks its {' and '.join(parts)}" for number, parts in missing.items() if parts]

    def write(self, name: FileName, content: bytes) -> None:
        """Write a file of a picture, unless it is there already. Raises InputError if the folder has another one."""
        path = self._folder / f"{name.part}{name.number}{name.suffix}"
        self.imported.add(name.number)
        before = self._files[name.number].get(name.part)
        if before is not None:
            if before != path.name or read_bytes(path, largest=LARGEST_FILE) != content:
                raise InputError(
                    f"{self._folder} has another {before} already: two pictures have the number {name.number}; import "
                    "one of them into another folder"
                )
            return
        if shutil.disk_usage(self._folder).free < len(content) + KEPT_FREE:
            raise InputError(
                f"the disk of {self._folder} has less than {KEPT_FREE >> 30} GiB left: free some space, and repeat the "
                "import, which then continues"
            )
        write_file(path, content)
        self._files[name.number][name.part] = path.name

    def holds(self, archive: str, stamp: str | None) -> bool:
        """Whether an archive was imported as a whole when it had this stamp."""
        return stamp is not None and self._whole.get(archive) == stamp

    def finish(self, archive: str, stamp: str | None) -> None:
        """Note that an archive was imported as a whole."""
        if stamp is not None:
            self._whole[archive] = stamp
            write_file(self._record, json.dumps(self._whole, indent=1) + "\n")
