"""Where frames come from: an image, a directory or glob of images, a video file, or a camera through OpenCV."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from ..arrays import Image
from ..detection.sampling import FORMATS
from ..errors import InputError
from .decoding import decode

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".pgm", ".ppm", ".tif", ".tiff", ".webp")


def check_file_format(format: str) -> None:
    """Raise InputError for a pixel format that frames read here can't have.

    OpenCV gives colors as BGR, or the one channel of a grey or Bayer file as it is.
    """
    if format in ("rgb", "bgra", "rgba"):
        allowed = ", ".join(name for name in FORMATS if name not in ("rgb", "bgra", "rgba"))
        raise InputError(f"--format {format} is for frames handed over in Python; those read here are {allowed}")


@dataclass(frozen=True)
class Frame:
    """One frame of a source.

    index: its number, from 0. source: what to call it. read: gives the image, BGR, or as the file has it if the pixel
    format is another; raises InputError. path: of its file, where it has one of its own. stamp: time in its video
    [s].
    """

    index: int
    source: str
    read: Callable[[], Image]
    path: Path | None = None
    stamp: float | None = None


@dataclass(frozen=True)
class Source:
    """Frames to iterate over, and where that is known how many there are, and how many a second."""

    frames: Iterator[Frame]
    count: int | None
    rate: float | None = None


def open_source(name: str, raw: bool = False) -> Source:
    """Open a source by name. `raw` leaves images in the channels that their files have.

    Raises InputError if it does not exist, holds no images or can't be opened.
    """
    try:
        return _open(name, Path(name), raw)
    except OSError as error:
        raise InputError(f"can't open {name[:200]}: {error.strerror or error}") from error


def _open(name: str, path: Path, raw: bool) -> Source:
    if path.is_dir():
        found = [each for each in path.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES]
        if not found:
            raise InputError(f"no images in directory {name} (looked for {', '.join(IMAGE_SUFFIXES)})")
        return _images(found, raw)
    if path.is_file() and path.suffix.lower() in IMAGE_SUFFIXES:
        return _images([path], raw)
    if path.exists() or name.isdigit():
        return _video(name)
    if glob.has_magic(name):
        matches = glob.glob(name, recursive=True)  # noqa: PTH207 (the pattern may begin anywhere, at / too)
        found = [Path(each) for each in matches if Path(each).suffix.lower() in IMAGE_SUFFIXES]
        if not found:
            raise InputError(f"no images match {name}")
        return _images(found, raw)
    raise InputError(f"no such image, directory, video or camera: {name}")


def _images(paths: list[Path], raw: bool) -> Source:
    paths = sorted(paths, key=_natural)
    frames = (Frame(index, path.name, partial(read_image, path, raw), path) for index, path in enumerate(paths))
    return Source(frames, len(paths))


def _natural(path: Path) -> list[tuple[int, str]]:
    """Order in which frame9 comes before frame10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def read_image(path: str | Path, raw: bool = False) -> Image:
    """An image file as BGR, or with `raw` in the channels it has. Raises InputError if it is missing or broken."""
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error
    try:
        return decode(content, raw)
    except InputError as error:
        raise InputError(f"{path} {error}") from error


def lens_beside(path: Path | None) -> Path | None:
    """lensNAME.yaml beside imageNAME.jpg, if it is there."""
    if path is None or not path.stem.startswith("image"):
        return None
    beside = path.with_name("lens" + path.stem.removeprefix("image") + ".yaml")
    return beside if beside.exists() else None


def _video(name: str) -> Source:
    """A video file, or a camera by number or device path."""
    capture = cv2.VideoCapture(int(name) if name.isdigit() else name)
    live = name.isdigit() or Path(name).is_char_device()
    if not capture.isOpened():
        raise InputError(f"can't open {'camera' if live else 'video'} {name}")
    count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    first = _grabbed(capture)
    if first is None:
        raise InputError(f"{'camera' if live else 'video'} {name} gives no frames")
    rate = capture.get(cv2.CAP_PROP_FPS)
    return Source(
        _captured(capture, first, Path(name).name),
        None if live or count <= 0 else count,
        rate if 0.0 < rate < 1e4 else None,
    )


def _captured(capture: cv2.VideoCapture, first: Image, name: str) -> Iterator[Frame]:
    image: Image | None = first
    index = 0
    while image is not None:
        stamp = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        yield Frame(index, name, partial(np.asarray, image), None, stamp)
        image = _grabbed(capture)
        index += 1
    capture.release()


def _grabbed(capture: cv2.VideoCapture) -> Image | None:
    """The next frame, or None at the end."""
    good, image = capture.read()
    return np.asarray(image, dtype=np.uint8) if good else None
