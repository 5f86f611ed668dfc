"""Read frames one by one from an image, a directory or glob of images, or a video file."""

from __future__ import annotations

import glob
import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

from ..arrays import Image
from ..borders.credentials import without_password
from ..borders.text import utf8
from ..detection.pixel_formats import FORMATS
from ..errors import InputError
from ..files import exists, is_file, read_bytes, read_text, there
from .camera import camera_number
from .decoding import decode
from .frame_source import IMAGE_SUFFIXES, Frame, Source, joined
from .image_header import MAX_MEGAPIXELS
from .video_files import open_video

MESSAGES = "recording.jsonl"
"""The file with the messages of a recording, one line for each image."""

_BESIDE = ("mask", "coverage", "lens", "scene")
"""First parts of the names of files that belong to a frame imageX of vm-synth, and are none."""


def check_read_format(format: str) -> None:
    """Raise InputError for a pixel format that frames of files and cameras never have.

    OpenCV reads colors as BGR and keeps the single channel of a gray or Bayer image.
    """
    never = ("rgb", "bgra", "rgba")
    if format in never:
        allowed = ", ".join(name for name in FORMATS if name not in never)
        raise InputError(
            f"--format {format} is only for frames passed in from Python; frames of files and cameras are {allowed}"
        )


def open_sources(names: Sequence[str], raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Source:
    """Open several sources by name, one after the other; images alone are in the order of their numbers.

    With `raw`, images keep the channels of their files. Larger images are not decoded [Mpx]. Raises InputError as
    `open_source` does.
    """
    names = list(map(_there, names))
    paths = _without_companions([Path(each) for each in names])
    kept = set(paths)
    names = [each for each in names if Path(each) in kept]
    if len(names) > 1 and all(is_file(each) and each.suffix.lower() in IMAGE_SUFFIXES for each in paths):
        return _images(paths, partial(read_image, raw=raw, max_megapixels=max_megapixels))
    return joined([open_source(each, raw, max_megapixels) for each in names])


def open_source(name: str, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Source:
    """Open a source by name. With `raw`, images keep the channels of their files. Larger images are not decoded [Mpx].

    Raises InputError if the source does not exist, contains no images or can't be opened.
    """
    name = _there(name)
    try:
        return _open(name, Path(name), raw, max_megapixels)
    except OSError as error:
        raise InputError(f"can't read {name[:200]}: {error.strerror or error}") from error


def _there(name: str) -> str:
    """The name of a source; of a file or folder as in `files.there`."""
    path = there(Path(name))
    return name if path == Path(name) else str(path)


def _open(name: str, path: Path, raw: bool, max_megapixels: float) -> Source:
    read = partial(read_image, raw=raw, max_megapixels=max_megapixels)
    if path.is_dir():
        found = [each for each in path.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES]
        if not found:
            raise InputError(f"no images in directory {name} (looked for {', '.join(IMAGE_SUFFIXES)}){_deeper(path)}")
        return _images(_without_companions(found), read, _recorded_times(path / MESSAGES))
    if path.is_file() and path.suffix.lower() in IMAGE_SUFFIXES:
        return _images([path], read)
    if path.exists() or camera_number(name) is not None:
        return open_video(name, max_megapixels)
    if glob.has_magic(name):
        matches = glob.glob(name, recursive=True)  # noqa: PTH207 (the pattern may begin anywhere, at / too)
        found = [Path(each) for each in matches if Path(each).suffix.lower() in IMAGE_SUFFIXES]
        if not found:
            raise InputError(f"no images match {name}")
        return _images(_without_companions(found), read)
    raise InputError(f"no such image, directory, video or camera: {without_password(name)}")


def _deeper(folder: Path) -> str:
    """The end of a message about a folder without images: a folder in it that has some, if there is one."""
    for inner in sorted(each for each in folder.iterdir() if each.is_dir()):
        with suppress(OSError):
            if any(each.suffix.lower() in IMAGE_SUFFIXES for each in inner.iterdir()):
                return f"; give the folders in it one by one, such as {inner}"
    return ""


def _without_companions(paths: Sequence[Path]) -> list[Path]:
    """The files without those, such as maskX and lensX, that vm-synth writes beside an imageX among them."""
    images = {each.parent / each.stem for each in paths}

    def belongs_to_an_image(path: Path) -> bool:
        stems = (f"image{path.stem.removeprefix(each)}" for each in _BESIDE if path.stem.startswith(each))
        return any(path.with_name(stem) in images for stem in stems)

    return [each for each in paths if not belongs_to_an_image(each)]


def _images(paths: list[Path], read: Callable[[Path], Image], times: Mapping[str, float] | None = None) -> Source:
    """The frames of image files. times: of some of them, by the names of the files without suffix [s]."""
    paths, times = sorted(paths, key=natural_key), times or {}
    frames = (
        Frame(index, utf8(path.name), path.stem, partial(read, path), path, times.get(path.stem))
        for index, path in enumerate(paths)
    )
    return Source(frames, len(paths), files=tuple(paths))


def _recorded_times(messages: Path) -> dict[str, float]:
    """When the images of a recording were taken, since the first [s], by their names without suffix.

    Empty for other folders. A recording that was cut off may lack the messages of its last images.
    """
    times: list[float] = []
    with suppress(InputError, ValueError, KeyError, TypeError, RecursionError):
        lines = read_text(messages).splitlines()
        times.extend(float(json.loads(line)["t"]) for line in lines)
    return {f"image{index:07d}": time - times[0] for index, time in enumerate(times)}


def natural_key(path: Path) -> list[tuple[int, str]]:
    """A sort key that puts frame9 before frame10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def read_image(path: str | Path, raw: bool = False, max_megapixels: float = MAX_MEGAPIXELS) -> Image:
    """Read an image file as BGR, or with `raw` in its own channels.

    Raises InputError if it is missing, broken, or larger than `max_megapixels` [Mpx].
    """
    path = Path(path)
    content = read_bytes(path)
    try:
        return decode(content, raw, max_megapixels)
    except InputError as error:
        raise InputError(f"{path} {error}") from error


def lens_place(path: Path | None) -> Path | None:
    """Where the lens file of imageNAME.jpg may be: lensNAME.yaml beside it. None for other names."""
    if path is None or not path.stem.startswith("image"):
        return None
    return path.with_name("lens" + path.stem.removeprefix("image") + ".yaml")


def lens_beside(path: Path | None) -> Path | None:
    """The file lensNAME.yaml beside imageNAME.jpg, or None if it does not exist."""
    place = lens_place(path)
    return None if place is None else _existing(place)


def lens_file_of(image: Path) -> Path | None:
    """The lens file of a frame of any tool: NAME.yaml, lensNAME.yaml, or for imageNAME lensNAME.yaml; None without."""
    beside = (image.with_suffix(".yaml"), image.with_name(f"lens{image.stem}.yaml"))
    return next(filter(None, map(_existing, beside)), None) or lens_beside(image)


def _existing(path: Path) -> Path | None:
    """The path as in `files.there`, or None if nothing is there."""
    path = there(path)
    return path if exists(path) else None
