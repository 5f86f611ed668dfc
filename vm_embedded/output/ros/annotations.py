"""Detections as drawings of Foxglove: outlines and labels over the image."""

from __future__ import annotations

from typing import Any

from ...detection.detection import Detection
from ...detection.detections import Detections

_LINE_LOOP = 2  # of PointsAnnotation
_YELLOW, _BLACK, _CLEAR = (1.0, 0.86, 0.24, 1.0), (0.0, 0.0, 0.0, 0.7), (0.0, 0.0, 0.0, 0.0)
_THICKNESS, _FONT = 2.0, 14.0  # [px]


def image_annotations(types: Any, stamp: Any, detections: Detections) -> Any:
    """A foxglove_msgs/ImageAnnotations with the outline, class, confidence and distance of each detection."""
    return types.ImageAnnotations(
        circles=[],
        points=[_outline(types, stamp, each) for each in detections],
        texts=[_label(types, stamp, each) for each in detections],
    )


def _outline(types: Any, stamp: Any, detection: Detection) -> Any:
    return types.PointsAnnotation(
        timestamp=stamp,
        type=_LINE_LOOP,
        points=[types.Point2(x=float(x), y=float(y)) for x, y in detection.outline],
        outline_color=_color(types, _YELLOW),
        outline_colors=[],
        fill_color=_color(types, _CLEAR),
        thickness=_THICKNESS,
    )


def _label(types: Any, stamp: Any, detection: Detection) -> Any:
    x, y = detection.center + detection.radius
    return types.TextAnnotation(
        timestamp=stamp,
        position=types.Point2(x=float(x), y=float(y)),
        text=f"{detection.class_name} {detection.confidence:.2f}  {detection.distance:.2f} m",
        font_size=_FONT,
        text_color=_color(types, _YELLOW),
        background_color=_color(types, _BLACK),
    )


def _color(types: Any, color: tuple[float, float, float, float]) -> Any:
    return types.Color(**dict(zip("rgba", color, strict=True)))
