"""Decoded pictures on disk. A training reads each picture many times, and decoding is the slowest step of that.

A file holds a header, the text of the lens file, the image (h, w, 3) uint8 and the labels (h, w) int8, all raw. It is
mapped into memory, so a mesh reads only the pixels that it needs.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import shutil
import struct
from contextlib import suppress
from pathlib import Path
from urllib.parse import quote

import numpy as np

from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write, open_regular

from .classes import Classes
from .picture_files import PARTS, PictureFiles
from .pictures import Picture, parse_lens, read_picture

_HEADER = struct.Struct("<8s32sIIII")  # magic, fingerprint, width, height, bytes of the lens text, zero
MAGIC = b"vmtrain1"
_FULL = "full"

_TURNED = "turned by EXIF"
"""Part of each fingerprint. Entries of versions that did not turn images count as absent."""

_LONGEST = 200
"""Longest name of a picture that becomes the name of a file; file systems allow 255 bytes."""
KEPT_FREE = 1 << 30
"""Disk space to leave for the other files of a training [bytes]."""


def decoded_size(count: int, width: int, height: int) -> int:
    """Disk space of decoded pictures [bytes]. width, height [px]."""
    return count * (4 * width * height + 4096)


class DecodedCache:
    """A folder of decoded pictures of one data set. Outdated or damaged entries count as absent.

    Files that it did not write stay as they are, also under the name of an entry: .raw is a suffix of cameras, too.
    Raises InputError if the folder can't be created.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if is_own(self._full_mark, b""):
                self._full_mark.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"can't use folder {folder}: {error.strerror or error}") from error
        self._full = False

    @property
    def full(self) -> bool:
        """Whether any process with this folder found the disk full; from then on, none of them adds a picture."""
        return self._full or self._full_mark.exists()

    def get(self, files: PictureFiles, classes: Classes) -> Picture | None:
        """The picture, read-only, or None if the entry is absent, or its files or the classes have changed since."""
        try:
            source = fingerprint(files, classes)
            with open_regular(self._path(files)) as file:
                content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            magic, found, width, height, text, _ = _HEADER.unpack_from(content)
            start, pixels = _HEADER.size + text, width * height
            if magic != MAGIC or found != source or len(content) != start + 4 * pixels:
                return None
            lens = parse_lens(content[_HEADER.size : start], files.lens.name)
        except (OSError, ValueError, struct.error, InputError):
            return None
        image = np.frombuffer(content, np.uint8, 3 * pixels, start).reshape(height, width, 3)
        labels = np.frombuffer(content, np.int8, pixels, start + 3 * pixels).reshape(height, width)
        return Picture(image, labels, lens)

    def put(self, files: PictureFiles, classes: Classes, picture: Picture) -> None:
        """Add a picture. Does nothing if the disk is full, or the file is another program's or can't be written."""
        height, width = picture.labels.shape
        try:
            path = self._path(files)
            if not is_own(path, MAGIC):
                return
            if shutil.disk_usage(self.folder).free < decoded_size(1, width, height) + KEPT_FREE:
                raise OSError
            text = files.read("lens")
            header = _HEADER.pack(MAGIC, fingerprint(files, classes), width, height, len(text), 0)
            with atomic_write(path) as part, part.open("wb") as file:
                for each in (header, text, picture.image.tobytes(), picture.labels.tobytes()):
                    file.write(each)
        except (OSError, InputError) as error:
            cause = error.__cause__ if isinstance(error, InputError) else error
            if not isinstance(cause, FileNotFoundError):
                self._full = True
                with suppress(OSError):
                    self._full_mark.touch()

    @property
    def _full_mark(self) -> Path:
        """An empty file. It tells all processes that one of them found the disk full."""
        return self.folder / _FULL

    def _path(self, files: PictureFiles) -> Path:
        name = quote(files.number, safe="", errors="surrogateescape")
        if len(name) > _LONGEST:
            name = hashlib.sha256(name.encode()).hexdigest()
        return self.folder / f"{name}.raw"


def is_own(path: Path, magic: bytes) -> bool:
    """Whether a cache may replace or remove a file: a regular one that is empty or begins with `magic`, or none."""
    try:
        with open_regular(path) as file:
            start = file.read(len(magic) or 1)
    except FileNotFoundError:
        return not path.is_symlink()
    except OSError:
        return False
    return start in (b"", magic) and not path.is_symlink()


def remove_entries(folder: Path, magic: bytes) -> None:
    """Remove the entries of a cache that begin with `magic`, and the folder unless it has other files."""
    with suppress(OSError):  # what can't be removed stays
        for path in folder.iterdir():
            unfinished = path.name.startswith(".") and path.name.endswith(".part")
            if (path.suffix == ".raw" or path.name == _FULL or unfinished) and is_own(path, magic):
                path.unlink(missing_ok=True)
        folder.rmdir()


def read_through_cache(files: PictureFiles, classes: Classes, cache: DecodedCache | None) -> Picture:
    """A picture from the cache, or else from its files, and then also added to the cache. Raises PictureFault."""
    if cache is None:
        return read_picture(files, classes)
    picture = cache.get(files, classes)
    if picture is None:
        picture = read_picture(files, classes)
        if not cache.full:
            cache.put(files, classes, picture)
    return picture


def fingerprint(files: PictureFiles, classes: Classes) -> bytes:
    """Digest of the sources of a decoded picture: sizes and times of its files, and the colors of the classes."""
    stats = [files.path(part).stat() for part in PARTS]
    content = _TURNED, [[each.st_size, each.st_mtime_ns] for each in stats], list(classes.colors.items())
    return hashlib.sha256(json.dumps(content).encode()).digest()
