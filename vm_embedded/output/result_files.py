"""Where detections go: JSON lines, point files and pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..arrays import Image
from ..cameras.image_files import Frame
from ..detection.detections import Detections
from ..errors import InputError
from ..files import atomic_write
from .overlay import draw


def json_line(frame: Frame, detections: Detections, emit_points: Sequence[str] = (), explain: bool = False) -> str:
    """One frame as a line of JSON (RFC 8259: no NaN).

    emit_points: classes whose points are listed with their bearings. explain: list the rejected clusters too.
    """
    data: dict[str, Any] = {
        "frame": frame.index,
        "source": frame.source,
        "stamp": None if frame.stamp is None else round(frame.stamp, 6),
        "points": len(detections.pixels),
        "detections": [each.as_dict() for each in detections],
    }
    if emit_points:
        data["class_points"] = {
            name: {
                "bearings": np.round(points.bearings, 4).tolist(),
                "probabilities": np.round(points.probabilities.astype(float), 3).tolist(),
            }
            for name in emit_points
            for points in [detections.points_of(name)]
        }
    if explain:
        data["rejected"] = [each.as_dict() for each in detections.rejected]
    data["timing_ms"] = {stage: round(value, 3) for stage, value in detections.timing_ms.items()}
    return json.dumps(data, allow_nan=False)


def frame_name(frame: Frame) -> str:
    """The name, without suffix, of the files that belong to a frame."""
    return frame.path.stem if frame.path else f"{Path(frame.source).stem}-{frame.index:06d}"


def save_points(folder: Path, frame: Frame, detections: Detections) -> Path:
    """Write NAME.npz with pixels (n, 2), rays (n, 3) in the frame's observation plane, probabilities (n, C)."""
    path = folder / f"{frame_name(frame)}.npz"
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez(file, pixels=detections.pixels, rays=detections.rays, probabilities=detections.probabilities)
    return path


def save_overlay(folder: Path, frame: Frame, image: Image, detections: Detections) -> Path:
    """Write NAME.jpg with mesh points and detections drawn into the image."""
    path = folder / f"{frame_name(frame)}.jpg"
    _, content = cv2.imencode(".jpg", draw(image, detections), [cv2.IMWRITE_JPEG_QUALITY, 92])
    with atomic_write(path) as part:
        part.write_bytes(content.tobytes())
    return path


def make_folder(path: Path) -> Path:
    """The folder, made if it is not there. Raises InputError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't make folder {path}: {error.strerror or error}") from error
    return path
