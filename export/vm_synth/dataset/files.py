"""The files of a set of pictures.

image0000012.jpg      the picture
mask0000012.png       the class of each pixel as a color
coverage0000012.png   the share of each pixel that the ball covers, 0 to 255
lens0000012.yaml      lens and camera pose, in the format of the reference implementation
scene0000012.json     description of the scene; written last, so a picture with this file is complete
set.json              seed, count, configuration and maps of the set
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import open_regular, read_regular
from vm_workstation.class_names import class_name

FORMAT = 1
"""Version of set.json and of scene*.json."""

CLASS_COLORS = {
    "ball": (255, 0, 0),
    "goal": (255, 255, 0),
    "line": (255, 255, 255),
    "field": (0, 255, 0),
    "environment": (0, 0, 0),
    "robot": (0, 0, 255),
}
"""RGB colors of the classes in masks; unlabeled pixels are transparent."""

SET = "set.json"
"""The file that defines a set."""

PARTS = {"image": ".jpg", "mask": ".png", "coverage": ".png", "lens": ".yaml", "scene": ".json"}
"""The parts of a picture and the suffixes of their files, in the order of writing."""


def file_of(folder: Path, part: str, index: int) -> Path:
    """The path of a part of a picture; part is one of PARTS."""
    return folder / f"{part}{index:07d}{PARTS[part]}"


_ENDS = {".jpg": b"\xff\xd9", ".png": b"IEND\xaeB`\x82", ".json": b"}\n", ".yaml": b"\n"}
"""The last bytes of a whole file, by its suffix."""


def is_done(folder: Path, index: int) -> bool:
    """Whether all files of a picture exist and none is cut short."""
    return all(_is_whole(file_of(folder, part, index)) for part in PARTS)


def _is_whole(path: Path) -> bool:
    end = _ENDS[path.suffix]
    try:
        with open_regular(path) as file:
            file.seek(-len(end), os.SEEK_END)
            return file.read() == end
    except OSError:  # it is missing, or shorter than its end
        return False


def files_in(folder: Path) -> Iterator[Path]:
    """The files of a set that are in a folder: set.json, and the parts of all pictures."""
    yield from folder.glob(SET)
    for part, suffix in PARTS.items():
        yield from folder.glob(f"{part}*{suffix}")


def indices_in(folder: Path) -> list[int]:
    """Sorted numbers of all pictures in a folder that have a scene*.json."""
    names = (path.stem.removeprefix("scene") for path in folder.glob("scene*.json"))
    return sorted(int(name) for name in names if name.isdecimal())


def read_truth(folder: Path, index: int) -> dict[str, Any]:
    """The description of a picture's scene, from its scene*.json. Raises InputError."""
    path = file_of(folder, "scene", index)
    try:
        truth = read_table(path)
        if isinstance(truth.get("object"), dict):
            class_name(str(truth["object"].get("name", "object")))
        return truth
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error


def read_table(path: Path) -> dict[str, Any]:
    """The object in a JSON file. Raises InputError if the file has no such content, OSError if it can't be read."""
    try:
        found = json.loads(read_regular(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {error}") from error
    if not isinstance(found, dict):
        raise InputError(f"{path} is damaged: it must contain a JSON object")
    return found
