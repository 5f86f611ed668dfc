"""Results of a frame: the objects and the points behind them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

import cv2
import numpy as np

from ..arrays import AnyImage, Floats, Image, Singles
from ..errors import InputError, unknown
from ..field.features import FieldFeatures
from ..files import write_file
from ..network.manifest import Manifest
from .detection import Detection
from .observation import Observation
from .overlay import draw_overlay

_PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
_ENCODING = dict.fromkeys((".jpg", ".jpeg"), (cv2.IMWRITE_JPEG_QUALITY, 92))
"""Parameters of OpenCV by suffix; other formats know no quality of JPEG."""


@dataclass(frozen=True, eq=False)
class ClassPoints:
    """The m points of a class.

    class_name: name of the class. bearings (m, 3): unit vectors from the camera, in the plane's frame. pixels (m, 2)
    [px]: where the points are in the image. probabilities (m,): of the class, above the threshold.
    """

    class_name: str
    bearings: Floats
    pixels: Floats
    probabilities: Singles

    def __len__(self) -> int:
        return len(self.bearings)


@dataclass(frozen=True, eq=False)
class Detections:
    """The objects of a frame, most confident first, and the n mesh points on screen.

    objects: the accepted objects. rejected: the rejected candidates, each with its reason; empty unless `explain` was
    set. observation: the points. threshold: a point belongs to a class if its probability is above this. timing_ms:
    time of each stage [ms]. field: goal posts, robots, lines and border of the field; None for a network without these
    classes, and with `field_features` off.
    """

    objects: tuple[Detection, ...]
    rejected: tuple[Detection, ...]
    observation: Observation
    threshold: float
    timing_ms: dict[str, float]
    field: FieldFeatures | None = None

    def __len__(self) -> int:
        return len(self.objects)

    def __iter__(self) -> Iterator[Detection]:
        return iter(self.objects)

    @overload
    def __getitem__(self, index: int) -> Detection: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Detection, ...]: ...

    def __getitem__(self, index: int | slice) -> Detection | tuple[Detection, ...]:
        return self.objects[index]

    def __repr__(self) -> str:
        return f"<{len(self.objects)} detections, {len(self.pixels)} points: {list(self.objects)}>"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, with the fields of a line of vm-detect: points, detections, field, timing_ms [ms].

        Without field features, the key `field` is missing.
        """
        data: dict[str, Any] = {
            "points": len(self.pixels),
            "detections": [each.as_dict() for each in self],
        }
        if self.field is not None:
            data["field"] = self.field.as_dict()
        data["timing_ms"] = {stage: round(value, 3) for stage, value in self.timing_ms.items()}
        return data

    def to_json(self) -> str:
        """The same as one line of JSON."""
        return json.dumps(self.as_dict(), allow_nan=False)

    def draw(self, image: AnyImage | None = None) -> Image:
        """A BGR copy of an image with the mesh points, objects and features of the field drawn in.

        image: uint8 (height, width[, channels]), BGR, BGRA or gray, of the frame's size; default: the frame itself.
        Objects have their outline, confidence and distance. Raises InputError for another size or type.
        """
        canvas = self.observation.pyramid.bgr() if image is None else _checked_canvas(image, self.observation.view.size)
        return draw_overlay(canvas, self.observation, self.objects, self.rejected, self.threshold, self.field)

    def save(self, path: str | Path) -> None:
        """Write the frame with all that was found drawn in (.jpg, .png and others), or the results as JSON (.json).

        Raises InputError for another suffix, or if the file can't be written.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix == ".json":
            content = self.to_json().encode() + b"\n"
        elif suffix in _PICTURES:
            good, encoded = cv2.imencode(suffix, self.draw(), _ENCODING.get(suffix, ()))
            content = encoded.tobytes() if good else b""
        else:
            raise InputError(f"can't write {path}: {unknown('suffix', suffix, (*_PICTURES, '.json'))}")
        if not content:
            raise InputError(f"can't write {path}: OpenCV can't encode it; a .webp has at most 16383 px on each side")
        write_file(path, content)

    @property
    def manifest(self) -> Manifest:
        """What the model file says about the network."""
        return self.observation.manifest

    @property
    def pixels(self) -> Floats:
        """Pixels (n, 2) of the points."""
        return self.observation.pixels

    @property
    def rays(self) -> Floats:
        """Unit vectors (n, 3) from the camera to the points, in the plane's frame, as in Detection."""
        return self.observation.rays

    @property
    def probabilities(self) -> Singles:
        """Probabilities (n, C) of the points, in the order of the manifest's classes."""
        return self.observation.probabilities

    def points_of(self, class_name: str) -> ClassPoints:
        """The points of a class with a probability above the threshold. Raises InputError for an unknown class."""
        column = self.probabilities[:, self.manifest.column(class_name)]
        chosen = np.flatnonzero(column > self.threshold)
        return ClassPoints(class_name, self.rays[chosen], self.pixels[chosen], column[chosen])


def _checked_canvas(image: AnyImage, size: tuple[int, int]) -> Image:
    """An image to draw into, width and height as given [px]. Raises InputError."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise InputError("image must be an array of uint8, (height, width[, channels])")
    if image.shape[1::-1] != size or (image.ndim == 3 and image.shape[2] not in (1, 3, 4)):
        raise InputError(
            f"image must have the size of the frame, {size[0]} x {size[1]} px, and 1, 3 or 4 channels, "
            f"not the shape {image.shape}"
        )
    return image
