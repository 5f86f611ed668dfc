"""Drawing features of the field into images: lines, circle, crossings, border, goal posts and robots."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Floats, Image
from ..borders.opencv_text import draw_text, text_size
from ..field.features import FieldFeatures, Upright
from .labels import INK, Color, Labels
from .prepared_view import PreparedView

# Colors are BGR. Magenta shows on white lines and on grass.
_LINE, BORDER, POST, ROBOT = (255, 0, 255), (255, 210, 0), (255, 190, 90), (60, 150, 255)

_PIECES = 16
"""Pieces of a straight line on the plane; most lenses bend it."""

FARTHEST = 1e4
"""Largest pixel that is drawn: OpenCV cannot draw far outside of an image."""


def draw_field(canvas: Image, field: FieldFeatures, view: PreparedView, scale: float) -> None:
    """Draw all features but their labels into a BGR image. scale: 1 for a picture of 1280 px."""
    thin = max(1, round(1.5 * scale))
    if field.border is not None:
        _draw_paths(canvas, view, _in_pieces(field.border.points)[None], BORDER, thin)
    if field.lines:
        ends = np.stack([each.ends for each in field.lines])
        _draw_paths(canvas, view, _in_pieces(ends.swapaxes(0, 1)).swapaxes(0, 1), _LINE, thin)
    if field.circle is not None:
        _draw_paths(canvas, view, field.circle.outline[None], _LINE, thin)
    for left, right in field.goals:
        ends = np.stack([field.posts[left].position, field.posts[right].position])
        _draw_paths(canvas, view, _in_pieces(ends)[None], POST, thin)
    for each, color in _uprights(field):
        _draw_paths(canvas, view, _base(each)[None], INK, 2 * thin + 3)
        _draw_paths(canvas, view, _base(each)[None], color, 2 * thin + 1)
    for crossing, pixel in zip(field.crossings, _crossing_pixels(field, view), strict=True):
        _draw_letter(canvas, crossing.kind, pixel, scale)


def label_field(labels: Labels, field: FieldFeatures, view: PreparedView) -> None:
    """Write class and distance beside posts and robots, the nearest first."""
    crossings = _crossing_pixels(field, view)
    for pixel in crossings[np.isfinite(crossings).all(axis=1)]:
        labels.avoid(pixel, 0.01 * view.size[0])
    for each, color in sorted(_uprights(field), key=lambda pair: pair[0].distance):
        if ((each.pixel >= 0) & (each.pixel < view.size)).all():
            half = 0.5 * view.lens.scale * each.width / each.distance
            labels.write(f"{each.class_name} {each.distance:.2f} m", each.pixel, half, color, 0.85)


def _uprights(field: FieldFeatures) -> list[tuple[Upright, Color]]:
    return [*((each, POST) for each in field.posts), *((each, ROBOT) for each in field.robots)]


def _crossing_pixels(field: FieldFeatures, view: PreparedView) -> Floats:
    """Pixels (c, 2) of the crossings; NaN where the lens sees nothing."""
    return view.plane_pixels(np.array([each.position for each in field.crossings]).reshape(-1, 2))


def _in_pieces(points: Floats) -> Floats:
    """Points (1 + _PIECES * (m - 1), ...) along the straight lines between points (m, ...)."""
    places = np.linspace(0.0, len(points) - 1.0, 1 + _PIECES * (len(points) - 1))
    whole = np.minimum(places.astype(np.intp), max(len(points) - 2, 0))
    rest = (places - whole).reshape(-1, *[1] * (points.ndim - 1))
    return np.asarray(points[whole] * (1.0 - rest) + points[np.minimum(whole + 1, len(points) - 1)] * rest)


def _base(upright: Upright) -> Floats:
    """Both ends (2, 2) [m] of the base, across the bearing."""
    across = np.array([-upright.bearing[1], upright.bearing[0]])
    across *= 0.5 * upright.width / max(float(np.hypot(*across)), 1e-9)
    return np.stack([upright.position + across, upright.position - across])


def _draw_paths(canvas: Image, view: PreparedView, paths: Floats, color: Color, thickness: int) -> None:
    """Draw p lines through n places each (p, n, 2) [m]; what the lens does not see is left out."""
    pixels = view.plane_pixels(paths.reshape(-1, 2)).reshape(paths.shape)
    with np.errstate(invalid="ignore"):
        seen = np.asarray((np.abs(pixels) < FARTHEST).all(axis=2))
    pieces = np.stack([pixels[:, :-1], pixels[:, 1:]], axis=2)[seen[:, :-1] & seen[:, 1:]]
    cv2.polylines(canvas, list(np.rint(pieces * 16).astype(np.int32)), False, color, thickness, cv2.LINE_AA, shift=4)


def _draw_letter(canvas: Image, letter: str, pixel: Floats, scale: float) -> None:
    """Write a letter in magenta on a white disk, its middle at a pixel (2,)."""
    if not (np.abs(pixel) < FARTHEST).all():
        return
    size, thickness = 0.5 * scale, max(1, round(1.5 * scale))
    width, height, _ = text_size(letter, size, thickness)
    x, y = np.rint(pixel).astype(int).tolist()
    cv2.circle(canvas, (x, y), round(0.8 * height), (255, 255, 255), cv2.FILLED, cv2.LINE_AA)
    place = round(x - width / 2), round(y + height / 2)
    draw_text(canvas, letter, place, size, _LINE, thickness)
