"""Files with the results of a frame: mesh points, and pictures with the detections drawn in."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..cameras.image_files import Frame
from ..detection.detections import Detections
from ..errors import InputError
from ..files import atomic_write


def save_points(folder: Path, frame: Frame, detections: Detections) -> Path:
    """Write NAME.npz with pixels (n, 2), rays (n, 3) in the frame's observation plane, probabilities (n, C)."""
    path = folder / f"{frame_name(frame)}.npz"
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez(file, pixels=detections.pixels, rays=detections.rays, probabilities=detections.probabilities)
    return path


def save_overlay(folder: Path, frame: Frame, detections: Detections) -> Path:
    """Write NAME.jpg: the image with mesh points and detections drawn in."""
    path = folder / f"{frame_name(frame)}.jpg"
    detections.save(path)
    return path


def frame_name(frame: Frame) -> str:
    """The name, without suffix, of the files of a frame."""
    return frame.path.stem if frame.path else f"{Path(frame.source).stem}-{frame.index:06d}"


def make_folder(path: Path) -> Path:
    """Create a folder unless it exists, and return it. Raises InputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't create folder {path}: {error.strerror or error}") from error
    return path
