"""The files of a folder of annotated images, in all its sub-folders."""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from vm_embedded.cameras.frame_source import IMAGE_SUFFIXES
from vm_embedded.errors import InputError
from vm_embedded.files import read_regular


@dataclass(frozen=True)
class FolderFiles:
    """All files below a folder, sorted; hidden ones are left out. images: those with the suffix of an image."""

    folder: Path
    images: tuple[Path, ...]
    others: tuple[Path, ...]

    def label(self, path: Path) -> str:
        """The path as seen from the folder, for messages."""
        return os.path.relpath(path, self.folder)

    def with_suffix(self, suffix: str) -> list[Path]:
        """The files that are not images and end with this suffix, such as .txt."""
        return [path for path in self.others if path.suffix.lower() == suffix]

    def images_by_key(self) -> dict[Path, list[Path]]:
        """Images by their path without suffix; two images may share a path."""
        found: dict[Path, list[Path]] = defaultdict(list)
        for path in self.images:
            found[path.with_suffix("")].append(path)
        return found


def find_files(folder: Path) -> FolderFiles:
    """All files below a folder. Raises InputError if it is no folder, or has no image in it."""
    if folder.is_file():
        raise InputError(f"{folder} is a file: give the folder with the images and their annotations")
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}")
    found: list[Path] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        found += [Path(place, name) for name in names if not name.startswith(".")]
    images = tuple(sorted(path for path in found if path.suffix.lower() in IMAGE_SUFFIXES))
    if not images:
        raise InputError(f"no images in {folder} (looked for {', '.join(IMAGE_SUFFIXES)})")
    return FolderFiles(folder, images, tuple(sorted(set(found) - set(images))))


def read_bytes(path: Path) -> bytes:
    """The content of an annotation file. Raises InputError without the file's name if it is unreadable."""
    try:
        return read_regular(path)
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror or error}") from error


def read_text(path: Path) -> str:
    """The text of an annotation file. Raises InputError without the file's name if it is unreadable."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not UTF-8 text") from error
