"""A trained peer from frame to boxes on one thread, and the places of its boxes on the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shapes import Sphere
from vm_workstation.outlines import shape_outline

from .networks import KEPT, OVERLAP, one_thread

LOWEST = 0.005
"""Boxes with a lower score are not reported."""

GRAY = (114, 114, 114)
"""The color around a picture that is not square, as in the training."""


@dataclass(frozen=True)
class TrainedPeer:
    """A peer: name, file name without suffix, side of its square input [px], and whether it stretches the picture."""

    name: str
    stem: str
    side: int
    stretches: bool


TRAINED = (
    TrainedPeer("SSDLite MobileNet v3, 320", "ssdlite", 320, True),
    TrainedPeer("YOLO nano, 320", "yolo320", 320, False),
    TrainedPeer("YOLO nano, 640", "yolo640", 640, False),
)


class BoxDetector:
    """A peer with the weights of a file of ONNX.

    The outputs of an SSD are boxes (n, 4) with their corners and scores (n,); that of a YOLO is (1, 5, n), centers,
    sizes and scores. Both are in pixels of the input.
    """

    def __init__(self, peer: TrainedPeer, path: Path) -> None:
        self._session = one_thread(str(path))
        self._input = self._session.get_inputs()[0].name
        self._peer = peer

    def detect(self, image: Image) -> tuple[Floats, Floats]:
        """Left, top, right, bottom (n, 4) [px] and scores (n,) of the balls in a BGR image (h, w, 3), best first."""
        side, (height, width) = self._peer.side, image.shape[:2]
        if self._peer.stretches:
            scale = np.array([width / side, height / side])
            square = cv2.resize(image, (side, side), interpolation=_interpolation(image, side))
        else:
            scale = np.full(2, max(width, height) / side)
            square = boxed_in(image, side)
        outputs = self._session.run(None, {self._input: cv2.dnn.blobFromImage(square, 1.0 / 255.0, swapRB=True)})
        if len(outputs) == 2:
            boxes, scores = outputs
            boxes = np.concatenate([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], axis=1)
        else:
            x, y, w, h, scores = outputs[0][0]
            boxes = np.stack([x - w / 2.0, y - h / 2.0, w, h], axis=1)
        best = np.argpartition(scores, -KEPT)[-KEPT:]
        kept = np.asarray(cv2.dnn.NMSBoxes(boxes[best].tolist(), scores[best].tolist(), LOWEST, OVERLAP), dtype=np.intp)
        chosen = best[kept.ravel()]
        corners = np.concatenate([boxes[chosen, :2], boxes[chosen, :2] + boxes[chosen, 2:]], axis=1)
        return np.clip(corners * np.tile(scale, 2), 0, (width, height) * 2), scores[chosen].astype(np.float64)


def boxed_in(image: Image, side: int) -> Image:
    """A picture (side, side, 3) that shows an image (h, w, 3) in its upper left corner, and gray around it."""
    height, width = image.shape[:2]
    scale = max(width, height) / side
    size = round(width / scale), round(height / scale)
    small = cv2.resize(image, size, interpolation=_interpolation(image, side))
    edges = (0, side - size[1], 0, side - size[0])
    return np.asarray(cv2.copyMakeBorder(small, *edges, cv2.BORDER_CONSTANT, value=GRAY))


def _interpolation(image: Image, side: int) -> int:
    return cv2.INTER_AREA if max(image.shape[:2]) > side else cv2.INTER_LINEAR


@dataclass(frozen=True, eq=False)
class FoundBox:
    """A box as a found object of `vm_train.scores`: its outline is the ellipse in the box.

    center (2,), radius [px]. position (3,), distance [m]: where the ray through the center meets the plane at the
    height of a ball's center, and the distance from the camera. size: side of the box over that of a ball there; NaN
    above the horizon.
    """

    confidence: float
    center: Floats
    radius: float
    outline: Floats
    bearing: Floats
    position: Floats
    distance: float
    size: float

    def is_possible(self, tolerance: float) -> bool:
        """Whether a ball on the plane may be as large as this box, up to a factor."""
        return 1.0 / tolerance <= self.size <= tolerance


def located(
    boxes: Floats, scores: Floats, size: Size, lens: Lens, orientation: Orientation, radius: float
) -> list[FoundBox]:
    """Found boxes (n, 4) [px] in a picture of this size [px], for balls of a radius [m].

    Boxes count from the edge of the first pixel, lenses and outlines from its center.
    """
    boxes = boxes - 0.5
    around = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    lens, sphere, found = lens.for_image(size), Sphere(radius), []
    camera = np.array([0.0, 0.0, orientation.height])
    centers, halves = (boxes[:, :2] + boxes[:, 2:]) / 2.0, (boxes[:, 2:] - boxes[:, :2]) / 2.0
    rays = lens.unproject(centers, size) @ orientation.rotation.T
    for score, center, half, ray in zip(scores, centers, halves, rays, strict=True):
        relative, share = np.full(3, np.nan), math.nan
        if ray[2] < 0.0:
            relative = sphere.center_along(ray[None], orientation.height)[0]
            ball = shape_outline(lens, orientation, sphere, relative + camera, size)
            with np.errstate(all="ignore"):
                share = float(2.0 * half.max() / _clipped_side(ball, size)) if np.isfinite(ball).all() else math.nan
        found.append(
            FoundBox(
                float(score),
                center,
                float(np.sqrt(half.prod())),
                center + half * circle,
                ray,
                relative + camera,
                float(np.linalg.norm(relative)),
                share,
            )
        )
    return found


def _clipped_side(outline: Floats, size: Size) -> float:
    """Longer side [px] of the part of an outline's box that is in the picture."""
    corners = np.clip([outline.min(axis=0), outline.max(axis=0)], 0.0, size)
    return float((corners[1] - corners[0]).max())


class FrameDetector:
    """A peer that `benchmarks.measured_frames` can score: it reports balls of a radius [m] from a score on.

    tolerance: as for `FoundBox.is_possible`, or None to report boxes of any size.
    """

    def __init__(self, detector: BoxDetector, radius: float, threshold: float, tolerance: float | None) -> None:
        self._detector, self._radius, self._threshold, self._tolerance = detector, radius, threshold, tolerance

    def detect(self, image: Image, orientation: Orientation, lens: Lens) -> SimpleNamespace:
        """The balls as `objects`, each a FoundBox."""
        boxes, scores = self._detector.detect(image)
        found = located(boxes, scores, (image.shape[1], image.shape[0]), lens, orientation, self._radius)
        return SimpleNamespace(objects=reported(found, self._threshold, self._tolerance))


def reported(found: Sequence[FoundBox], threshold: float, tolerance: float | None) -> list[FoundBox]:
    """The boxes from a score on whose size is possible; of any size without a tolerance."""
    return [
        each for each in found if each.confidence >= threshold and (tolerance is None or each.is_possible(tolerance))
    ]
