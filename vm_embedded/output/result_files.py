"""Files with the results of a frame: mesh points, and pictures: the frame with the detections drawn in, and a map."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from ..arrays import Image
from ..cameras.frame_source import Frame
from ..detection.detections import Detections
from ..errors import InputError
from ..files import atomic_write, is_file, write_file

# Smaller and faster than the default strategy for pictures with noise.
_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY)


def save_points(path: Path, detections: Detections) -> None:
    """Write an .npz with pixels (n, 2), rays (n, 3) in the frame's observation plane, probabilities (n, C)."""
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez(file, pixels=detections.pixels, rays=detections.rays, probabilities=detections.probabilities)


def save_overlay(path: Path, frame: Frame, detections: Detections) -> None:
    """Write a .jpg: the image with mesh points and detections drawn in.

    Raises InputError instead of replacing a file in the folder of the frame's own image.
    """
    _check_beside(path, frame, "--save-overlay")
    detections.save(path)


def save_map(path: Path, frame: Frame, detections: Detections) -> None:
    """Write a .png: what the frame shows, from above. Raises InputError as `save_overlay` does."""
    _check_beside(path, frame, "--save-map")
    write_file(path, cv2.imencode(".png", detections.draw_map())[1].tobytes())


def _check_beside(path: Path, frame: Frame, option: str) -> None:
    if frame.path is not None and is_file(path) and path.resolve().parent == frame.path.resolve().parent:
        raise InputError(f"{option} would replace {path}: give another folder")


class FrameNames:
    """Names, without suffix, for the files of frames, all different. With a prefix, each name begins with it."""

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self._given: set[str] = set()

    def of(self, frame: Frame) -> str:
        """A name that no frame had before: that of its file; with a number for frames of a video."""
        base = frame.stem if frame.path else f"{frame.stem}-{frame.index:06d}"
        if self._prefix and not base.startswith(self._prefix):
            base = f"{self._prefix}-{base}"
        name, number = base, 1
        while name in self._given:
            number += 1
            name = f"{base}-{number}"
        self._given.add(name)
        return name


def make_folder(path: Path) -> Path:
    """Create a folder unless it exists, and return it. Raises InputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't create folder {path}: {error.strerror or error}") from error
    return path


def encode_png(image: Image) -> bytes:
    """A lossless PNG of an image (height, width[, channels]), which takes little time to compress."""
    return cv2.imencode(".png", image, _PNG)[1].tobytes()
