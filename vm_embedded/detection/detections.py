"""Results of a frame: the objects and the points behind them."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, overload

import cv2
import numpy as np

from ..arrays import AnyImage, Floats, Image, Singles, one_number
from ..borders.records import SIZE, Record, Sent
from ..errors import InputError, one_line, unknown
from ..field.features import FieldFeatures
from ..files import write_file
from ..network.manifest import Manifest
from .detection import Detection
from .observation import Observation
from .overhead import draw_overhead
from .overlay import draw_overlay
from .pose_state import PoseState

STAGES = ("mesh", "project", "sample", "infer", "propose", "look", "cluster", "field", "track", "total")
"""Parts of the work on a frame; its time has an entry for each that was needed, and `total`."""

_PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp", ".tif", ".tiff")
_ENCODING = dict.fromkeys((".jpg", ".jpeg"), (cv2.IMWRITE_JPEG_QUALITY, 92))
"""Parameters of OpenCV by suffix; other formats know no quality of JPEG."""


@dataclass(frozen=True, eq=False)
class ClassPoints(Record):
    """The m points of a class.

    class_name: name of the class. bearings (m, 3): unit vectors from the camera, in the plane's frame. pixels (m, 2)
    [px]: where the points are in the image. probabilities (m,): of the class, above the threshold.
    """

    class_name: str
    bearings: Annotated[Floats, Sent(4, (-1, 3))]
    pixels: Floats
    probabilities: Annotated[Singles, Sent(3, (-1,), least=0, most=1)]

    def __len__(self) -> int:
        return len(self.bearings)


@dataclass(frozen=True, kw_only=True)
class Results(Record):
    """What messages have of a frame.

    points: number of mesh points on screen. detections: the objects, most confident first. field: features of the
    field; only with a network that knows them. pose: what the frames so far say about the camera's pose; null if it is
    not checked. timing_ms [ms]: time of each stage and of the whole call.
    """

    points: Annotated[int, SIZE]
    detections: Annotated[tuple[Detection, ...], Sent()]
    field: Annotated[FieldFeatures | None, Sent()] = None
    pose: Annotated[PoseState | None, Sent(null=True)] = None
    timing_ms: Annotated[Mapping[str, float], Sent(least=0, allowed=STAGES)]


@dataclass(frozen=True, eq=False)
class Detections:
    """The objects of a frame, most confident first, and the n mesh points on screen.

    objects: the accepted objects. rejected: the rejected candidates, each with its reason; empty unless `explain` was
    set. observation: the points. threshold: a point belongs to a class if its probability is above this. timing_ms:
    time of each stage [ms]. field: goal posts, robots, lines and border of the field; None for a network without these
    classes, and with `field_features` off. pose: what this frame and those before say about the camera's pose, if a
    PoseCheck collects it.
    """

    objects: tuple[Detection, ...]
    rejected: tuple[Detection, ...]
    observation: Observation
    threshold: float
    timing_ms: dict[str, float]
    field: FieldFeatures | None = None
    pose: PoseState | None = None

    def __len__(self) -> int:
        return len(self.objects)

    def __iter__(self) -> Iterator[Detection]:
        return iter(self.objects)

    @overload
    def __getitem__(self, index: int) -> Detection: ...

    @overload
    def __getitem__(self, index: slice) -> Detections: ...

    def __getitem__(self, index: int | slice) -> Detection | Detections:
        """One object, or with a slice the same Detections with some of their objects."""
        return replace(self, objects=self.objects[index]) if isinstance(index, slice) else self.objects[index]

    def __repr__(self) -> str:
        return f"<{len(self.objects)} detections, {len(self.pixels)} points: {list(self.objects)}>"

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON, with the fields of a line of vm-detect: points, detections, field, pose, timing_ms.

        Without field features, the key `field` is missing.
        """
        return results(self).as_dict()

    def filter(
        self,
        class_name: str | Iterable[str] | None = None,
        *,
        min_confidence: float = 0.0,
        min_distance: float = 0.0,
        max_distance: float = math.inf,
    ) -> Detections:
        """The same Detections with some of their objects; the points and features of the field stay.

        class_name: one class or several; None: all. min_confidence: 0 to 1. min_distance, max_distance [m]: from the
        camera to the object's center. Each limit is included. Raises InputError for a class that gives no objects, and
        if a limit is not a number.
        """
        names = self._object_classes()
        chosen = names if class_name is None else _listed(class_name)
        for each in chosen:
            if each not in names:
                raise InputError(unknown("class", each, names))
        confidence = _checked_limit(min_confidence, "min_confidence")
        nearest, farthest = _checked_limit(min_distance, "min_distance"), _checked_limit(max_distance, "max_distance")
        kept = (
            each
            for each in self
            if each.class_name in chosen and each.confidence >= confidence and nearest <= each.distance <= farthest
        )
        return replace(self, objects=tuple(kept))

    @property
    def xyxy(self) -> Floats:
        """Boxes (k, 4) [px] around the outlines of the k objects, cut at the edges of the image: left, top, right,
        bottom. A box that covers the first pixel begins at 0, and one that covers the last one ends at the width or
        height. The box of an object whose outline the lens does not see is empty."""
        size = self.observation.view.size
        outlines = [each.outline if len(each.outline) > 2 else each.center[None] for each in self]
        return np.array([edges_in_image(each, size) for each in outlines]).reshape(-1, 4)

    def to_rows(self) -> list[dict[str, Any]]:
        """The objects as rows of plain numbers, for pandas.DataFrame(detections.to_rows()).

        class, confidence, distance; x, y, z: position [m]; xmin, ymin, xmax, ymax: as in `xyxy`; center_x, center_y,
        radius, angular_radius, distance_by_angle, distances_agree, points; track: its number, or None.
        """
        return [to_row(each, box) for each, box in zip(self, self.xyxy, strict=True)]

    def to_supervision(self) -> Any:
        """The objects as supervision.Detections, for its annotators and trackers.

        class_id: the number of the class among those that give objects. tracker_id: the number of the track, or -1;
        None without tracks. data: class_name, distance (k,) [m] and position (k, 3) [m]. Raises InputError if the
        package supervision is not installed.
        """
        try:
            supervision = import_module("supervision")
        except ImportError as error:
            raise InputError(
                f"to_supervision needs the package supervision; run: pip install supervision ({one_line(error)})"
            ) from error
        names = self._object_classes()
        tracks = [-1 if each.track is None else each.track.id for each in self]
        return supervision.Detections(
            xyxy=self.xyxy,
            confidence=np.array([each.confidence for each in self]),
            class_id=np.array([names.index(each.class_name) for each in self], dtype=int),
            tracker_id=np.array(tracks) if any(each > 0 for each in tracks) else None,
            data={
                "class_name": np.array([each.class_name for each in self], dtype=str),
                "distance": np.array([each.distance for each in self]),
                "position": np.array([each.position for each in self]).reshape(-1, 3),
            },
        )

    def _object_classes(self) -> list[str]:
        """The names of the classes that give objects."""
        return [each.name for each in self.manifest.classes if each.kind == "object"]

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

    def draw_map(self) -> Image:
        """A BGR image of the plane from above: 50 px per meter, the camera looks up, and rings are 2 m apart.

        It shows what the frame shows of the plane, up to 12 m, with objects and features of the field.
        """
        return draw_overhead(self.observation.view, self.objects, self.field)

    def save(self, path: str | Path) -> None:
        """Write the frame with all that was found drawn in (.jpg, .png and others), the results as JSON (.json), or
        the rows of the objects (.csv).

        Raises InputError for another suffix, or if the file can't be written.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        if suffix == ".json":
            content = self.to_json().encode() + b"\n"
        elif suffix == ".csv":
            content = to_csv(self.to_rows()).encode()
        elif suffix in _PICTURES:
            good, encoded = cv2.imencode(suffix, self.draw(), _ENCODING.get(suffix, ()))
            content = encoded.tobytes() if good else b""
        else:
            raise InputError(f"can't write {path}: {unknown('suffix', suffix, (*_PICTURES, '.json', '.csv'))}")
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


def results(found: Detections) -> Results:
    """What messages have of these detections."""
    return Results(
        points=len(found.pixels),
        detections=found.objects,
        field=found.field,
        pose=found.pose,
        timing_ms=found.timing_ms,
    )


def edges_in_image(outline: Floats, size: tuple[int, int]) -> Floats:
    """The edges (4,) [px] of the box around the part of an outline (m, 2) [px] that is in an image, as in
    Detections.xyxy. size: width and height of the image [px]. In outlines, pixel centers are whole numbers."""
    edges = np.stack([outline.min(axis=0), outline.max(axis=0)]) + 0.5
    return np.asarray(edges.clip(0.0, size).reshape(4))


def _listed(given: object) -> list[Any]:
    """One value as a list, and several as one."""
    return list(given) if isinstance(given, Iterable) and not isinstance(given, str) else [given]


def _checked_limit(value: object, name: str) -> float:
    """A limit as a number. Raises InputError for anything else, also for NaN, which would leave out every object."""
    limit = one_number(value, name)
    if math.isnan(limit):
        raise InputError(f"{name} must be a number, not NaN")
    return limit


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


COLUMNS = (
    *("class", "confidence", "distance", "x", "y", "z", "xmin", "ymin", "xmax", "ymax", "center_x", "center_y"),
    *("radius", "angular_radius", "distance_by_angle", "distances_agree", "points", "track"),
)
"""x, y, z: of the position. xmin to ymax: the box in the image. track: its number. The rest is as in the JSON."""

Row = dict[str, Any]


def to_row(detection: Detection, box: Floats) -> Row:
    """An object as plain numbers, one for each column. box (4,) [px]: as in Detections.xyxy."""
    fields = detection.as_dict()
    fields |= zip("xyz", fields["position"], strict=True)
    fields |= zip(("xmin", "ymin", "xmax", "ymax"), box.round(1).tolist(), strict=True)
    fields |= zip(("center_x", "center_y"), fields["center"], strict=True)
    fields["track"] = None if detection.track is None else detection.track.id
    return {name: fields[name] for name in COLUMNS}


def to_csv(rows: list[Row]) -> str:
    """A table with a line of column names, also if it has no rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
