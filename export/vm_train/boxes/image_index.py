"""Finds the image that an annotation file means, by its path or its name."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path, PurePath, PureWindowsPath
from unicodedata import normalize

from vm_embedded.errors import InputError
from vm_embedded.files import there

from .annotation import Annotation, Annotations
from .findings import SEVERAL, Finding
from .folder_files import FolderFiles

_IMAGE_FOLDERS = ("JPEGImages", "images")
_MOST_LABELS = 4
_ANNOTATION_FOLDERS = ("annotations", "labels")


class ImageIndex:
    """The images of a folder by their names."""

    def __init__(self, files: FolderFiles) -> None:
        self._files = files
        self._images = set(files.images)
        self._by_name: dict[str, list[Path]] = defaultdict(list)
        self._by_stem: dict[str, list[Path]] = defaultdict(list)
        self._by_place: dict[tuple[Path, str], list[Path]] = defaultdict(list)
        for path in files.images:
            self._by_name[_same(path.name)].append(path)
            self._by_stem[_same(path.stem)].append(path)
            self._by_place[path.parent, _same(path.stem)].append(path)

    def of_stem(self, annotation: Path) -> list[Path]:
        """The images with the stem of an annotation file: those beside it or in its folder of images, or else all."""
        stem = _same(annotation.stem)
        near = [path for folder in image_folders(annotation) for path in self._by_place.get((folder, stem), [])]
        return near or self._by_stem.get(stem, [])

    def named(self, name: str, near: Sequence[Path]) -> Path:
        """The image of a name, with or without folders, in one of the folders `near` or anywhere.

        Raises InputError if there is none, or several.
        """
        parts = _parts(name)
        for folder in near:
            if (path := there(folder.joinpath(*parts))) in self._images:
                return path
        found = self.of_name(name)
        if not found:
            raise InputError(f"there is no image {name[:200]!r}")
        if len(found) > 1:
            raise InputError(f"{name!r} may be {self.labels(found)}: two images with one name")
        return found[0]

    def of_name(self, name: str) -> list[Path]:
        """All images of a name, in any folder."""
        parts = _parts(name)
        return self._by_name.get(_same(parts[-1]), []) if parts else []

    def labels(self, paths: Iterable[Path]) -> str:
        """Paths below the folder, joined, for messages; at most _MOST_LABELS of them."""
        shown = [self._files.label(path) for path in islice(paths, _MOST_LABELS + 1)]
        return " and ".join(shown if len(shown) <= _MOST_LABELS else [*shown[:_MOST_LABELS], "others"])


def _same(name: str) -> str:
    """A name in the normal form in which names compare; see `files.there`."""
    return normalize("NFC", name)


def image_folders(annotation: Path) -> list[Path]:
    """Folders in which the images of an annotation file may lie: its own, and JPEGImages/ or images/ beside it."""
    folders = [annotation.parent]
    parts = annotation.parent.parts
    for level, part in enumerate(parts):
        if part.lower() in _ANNOTATION_FOLDERS:
            folders += [Path(*parts[:level], name, *parts[level + 1 :]) for name in _IMAGE_FOLDERS]
    return folders


def _parts(name: str) -> tuple[str, ...]:
    """The parts of a path that a program wrote on any system, without drive and root."""
    path: PurePath = PureWindowsPath(name)
    return tuple(part for part in path.parts if part != path.anchor and part != "..")


def once_each(files: FolderFiles, found: Sequence[Annotation]) -> Annotations:
    """Annotations without the images that several files annotate; those are faults."""
    by_image: dict[Path, list[Annotation]] = defaultdict(list)
    for each in found:
        by_image[each.image].append(each)
    several = {image: some for image, some in by_image.items() if len(some) > 1}
    faults = [
        Finding(SEVERAL, f"{files.label(image)}: annotated by {' and by '.join(each.file for each in some)}; not used")
        for image, some in several.items()
    ]
    single = tuple(each for each in found if each.image not in several)
    return Annotations(single, tuple(faults), frozenset(several))
