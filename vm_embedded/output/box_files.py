"""Boxes of detections, for annotation tools and for the labeling page of vm-label.

A folder of boxes holds, for each frame: the image imageNAME.*, its objects in imageNAME.txt in YOLO format, and its
lens and pose in lensNAME.yaml. A line of a YOLO file is `class x y width height`: the number of the class in
classes.txt, then center and size as shares of the image.

candidates.jsonl has a line of JSON for each box with its confidence. It also has the near misses: rejected candidates
that may be objects. They are in no YOLO file, because a tool would take them for objects.

object.toml has the shape and size of the objects, so that the box of one follows from lens, pose and its place.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Floats, Image, number_or_nan
from ..cameras.frame_source import Frame
from ..config.toml_reader import parse_toml
from ..detection.detections import Detections, edges_in_image
from ..errors import InputError, VisualMeshError, unknown
from ..files import exists, read_bytes, read_text, write_file
from ..geometry.lens import Lens
from ..geometry.lens_files import format_lens_file
from ..geometry.orientation import Orientation
from ..geometry.shape import Shape
from ..geometry.shapes import make_shape
from ..network.manifest import Manifest
from .result_files import FrameNames, encode_png, make_folder

CLASSES, CANDIDATES, OBJECT = "classes.txt", "candidates.jsonl", "object.toml"

Shares = tuple[float, float, float, float]
"""Center x and y, width and height of a box, as shares of the image's width and height."""

Edges = tuple[float, float, float, float]
"""Left, top, right and bottom edge of a box; x points right, y down."""

SAME_PLACE = 0.5
"""Intersection over union above which two boxes of a class show the same object."""

_NEAR_MISS = 0.05
"""Lowest confidence of a near miss."""

LEAST_SIDE = 2.0
"""Boxes with a shorter side [px] are left out: nobody can judge them."""


@dataclass(frozen=True)
class CandidateBox:
    """A box of an image. confidence: 0 to 1. found: whether it is a detection; otherwise it is a near miss."""

    class_name: str
    shares: Shares
    confidence: float
    found: bool


class BoxWriter:
    """Writes a folder of boxes, frame by frame.

    folder: must be new or empty. manifest: of the network; its classes of kind object have boxes. Raises InputError for
    a folder with files, or if it can't be created.
    """

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        try:
            is_empty = not any(make_folder(folder).iterdir())
        except OSError as error:
            raise InputError(f"can't read folder {folder}: {error.strerror or error}") from error
        if not is_empty:
            raise InputError(f"--save-boxes {folder}: the folder is not empty; give a new one, to keep its labels")
        self._folder, self._manifest = folder, manifest
        self._classes = tuple(each.name for each in manifest.classes if each.kind == "object")
        self._names = FrameNames("image")  # so that the lens file belongs to the image

    def write(self, frame: Frame, image: Image, lens: Lens, orientation: Orientation, detections: Detections) -> Path:
        """Write the files of a frame, and return the path of its image.

        image: uint8 (height, width[, channels]), written as PNG if the frame has no file. detections: with the rejected
        candidates. Raises InputError.
        """
        name, boxes = self._names.of(frame), _candidate_boxes(detections, (image.shape[1], image.shape[0]))
        if not (self._folder / CLASSES).exists():  # not earlier: if no frame can be processed, the folder stays empty
            write_file(self._folder / OBJECT, _object_file(self._manifest))
            write_file(self._folder / CLASSES, "".join(f"{name}\n" for name in self._classes))
        path = self._folder / f"{name}{'.png' if frame.path is None else frame.path.suffix}"
        write_file(path, encode_png(image) if frame.path is None else read_bytes(frame.path))
        lens_file = format_lens_file(lens, orientation)
        write_file(self._folder / f"lens{name.removeprefix('image')}.yaml", lens_file)
        labels = [yolo_line(self._classes.index(each.class_name), each.shares) for each in boxes if each.found]
        write_file(self._folder / f"{name}.txt", "".join(labels))
        self._append_candidates("".join(_json_line(path.name, each) for each in boxes))
        return path

    def _append_candidates(self, lines: str) -> None:
        path = self._folder / CANDIDATES
        try:
            with path.open("a", encoding="utf-8") as file:
                file.write(lines)
        except OSError as error:
            raise InputError(f"can't write {path}: {error.strerror or error}") from error


def _object_file(manifest: Manifest) -> str:
    height = f"height = {manifest.object_height!r}  # [m]\n" if manifest.object_height else ""
    return f'shape = "{manifest.shape}"\nradius = {manifest.object_radius!r}  # [m]\n{height}'


def read_object_file(folder: Path) -> Shape | None:
    """The shape of the objects in a folder of boxes; None if it has no object.toml. Raises InputError."""
    path = folder / OBJECT
    if not exists(path):
        return None
    try:
        table = parse_toml(read_text(path))
        unexpected = table.keys() - {"shape", "radius", "height"}
        if unexpected:
            raise InputError(unknown("entry", min(unexpected), ("shape", "radius", "height")))
        size = (number_or_nan(table.get("radius")), number_or_nan(table.get("height", 0.0)))
        return make_shape(str(table.get("shape", "sphere")), *size)
    except VisualMeshError as error:
        raise InputError(f"{path}: {error}") from error


def yolo_line(number: int, shares: Shares) -> str:
    """The line of a box in a label file in YOLO format. number: of its class in the table of names."""
    return f"{number} {' '.join(f'{each:.6f}' for each in shares)}\n"


def _candidate_boxes(detections: Detections, size: tuple[int, int]) -> list[CandidateBox]:
    """The boxes of detections, and after them those of near misses, each most confident first.

    size: width and height of the image [px]. A near miss at the place of a better box of its class is left out.
    """
    near = sorted((each for each in detections.rejected if each.confidence >= _NEAR_MISS), key=lambda e: -e.confidence)
    boxes: list[CandidateBox] = []
    for each in (*detections.objects, *near):
        shares, found = bounding_box(each.outline, size), each.reason is None
        if shares is None:
            continue
        others = (edges(other.shares) for other in boxes if other.class_name == each.class_name)
        if found or all(overlap(edges(shares), other) <= SAME_PLACE for other in others):
            boxes.append(CandidateBox(each.class_name, shares, round(each.confidence, 3), found))
    return boxes


def bounding_box(outline: Floats, size: tuple[int, int]) -> Shares | None:
    """The bounding rectangle of the part of an outline (m, 2) [px] that is in an image; None if hardly any of it is.

    size: width and height of the image [px]. Pixel centers are whole numbers. The shares have six digits.
    """
    if len(outline) < 3 or not np.isfinite(outline).all():
        return None
    low, high = edges_in_image(outline, size).reshape(2, 2)
    if (high - low).min() < LEAST_SIDE:
        return None
    x, y, width, height = np.concatenate([(low + high) / 2 / size, (high - low) / size]).round(6).tolist()
    return x, y, width, height


def edges(shares: Shares) -> Edges:
    """The edges of a box, as shares of the image's width and height."""
    x, y, width, height = shares
    return x - width / 2, y - height / 2, x + width / 2, y + height / 2


def overlap(one: Edges, other: Edges) -> float:
    """Intersection over union of two boxes with edges of the same unit, from 0 to 1; of boxes without an area 0."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    shared = max(width, 0.0) * max(height, 0.0)
    union = sum((right - left) * (bottom - top) for left, top, right, bottom in (one, other)) - shared
    return shared / union if union > 0.0 else 0.0


def _json_line(image: str, box: CandidateBox) -> str:
    fields = {"image": image, "class": box.class_name, "box": box.shares}
    return json.dumps(fields | {"confidence": box.confidence, "found": box.found}) + "\n"
