"""Drawing the overhead map: what a frame shows of the plane, from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from ..arrays import Floats, Image
from ..borders.opencv_text import draw_text
from ..field.features import FieldFeatures, Upright
from .detection import Detection
from .field_of_view import REACH, field_of_view
from .field_overlay import BORDER, POST, ROBOT
from .labels import INK, OBJECT, Color, Labels
from .prepared_view import PreparedView

_SCALE = 50.0
"""Pixels per meter."""

_MARGIN = 0.5
"""Width of the edge around what the picture shows [m]."""

_RING = 2.0
"""Distance between the rings around the camera [m]."""

_SEEN, _RINGS, _LINE = (60, 95, 50), (140, 140, 140), (255, 255, 255)
_FRACTION = 4
"""Binary digits of a pixel in drawings of OpenCV."""


def draw_overhead(view: PreparedView, objects: Sequence[Detection], field: FieldFeatures | None) -> Image:
    """The image of `Detections.draw_map`."""
    seen = [each @ view.heading[:2, :2] for each in field_of_view(view)]
    corners = np.concatenate([*seen, np.zeros((1, 2))])
    ahead, left = corners.max(axis=0) + _MARGIN
    height, width = np.ceil(_SCALE * (np.array([ahead, left]) + _MARGIN - corners.min(axis=0))).astype(int).tolist()
    canvas = np.full((height, width, 3), INK, np.uint8)

    def pixels(places: Floats) -> Floats:
        """Pixels (n, 2) of places (n, 2) on the plane."""
        x, y = (places @ view.heading[:2, :2]).T
        return _SCALE * np.column_stack([left - y, ahead - x])

    def draw(places: Floats, color: Color, thickness: int = 2) -> None:
        cv2.polylines(canvas, [_fixed(pixels(places))], False, color, thickness, cv2.LINE_AA, shift=_FRACTION)

    cv2.fillPoly(canvas, [_fixed(_SCALE * ((left, ahead) - each[:, ::-1])) for each in seen], _SEEN, shift=_FRACTION)
    (camera,) = np.rint(pixels(np.zeros((1, 2)))).astype(int).tolist()
    for distance in np.arange(_RING, REACH + _RING, _RING):
        radius = round(_SCALE * distance)
        cv2.circle(canvas, camera, radius, _RINGS, 1, cv2.LINE_AA)
        draw_text(canvas, f"{distance:.0f} m", (camera[0] + 4, camera[1] - radius - 4), 0.45, _RINGS)
    cv2.fillPoly(canvas, [np.add(camera, [(-8, 10), (0, -12), (8, 10)])], OBJECT, cv2.LINE_AA)
    things: list[tuple[Detection | Upright, float, Color]] = [(each, view.shape.radius, OBJECT) for each in objects]
    if field is not None:
        if field.border is not None:
            draw(field.border.points, BORDER)
        for line in field.lines:
            draw(line.ends, _LINE)
        if field.circle is not None:
            draw(field.circle.outline, _LINE)
        for goal in field.goals:
            draw(np.stack([field.posts[each].position for each in goal]), POST)
        things += [(each, 0.5 * each.width, POST) for each in field.posts]
        things += [(each, 0.5 * each.width, ROBOT) for each in field.robots]
    labels = Labels(canvas, 0.8)
    for each, half, color in things:
        (pixel,) = pixels(each.position[None, :2])
        if ((pixel >= 0) & (pixel < (width, height))).all():
            size = max(4.0, _SCALE * half)
            cv2.circle(canvas, np.rint(pixel).astype(int).tolist(), round(size), color, cv2.FILLED, cv2.LINE_AA)
            labels.write(f"{each.class_name} {each.distance:.2f} m", pixel, size, color)
    return canvas


def _fixed(pixels: Floats) -> Any:
    """Pixels (n, 2) as OpenCV takes them with `shift`."""
    return np.rint(pixels * 2**_FRACTION).astype(np.int32)
