"""Drawing mesh points, detections and features of the field into images."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ..arrays import Image
from ..field.features import FieldFeatures
from .detection import Detection
from .field_overlay import FARTHEST, draw_field, label_field
from .labels import INK, OBJECT, Color, Labels
from .observation import Observation
from .prepared_view import PreparedView

# Colors are BGR. Objects stand out; classes that cover areas are pale.
_REJECTED = (90, 90, 255)
_HORIZON = (190, 190, 240)
_UPRIGHT, _OTHER = (255, 120, 60), (140, 140, 140)
_AREAS = ((255, 255, 255), (190, 255, 170), (230, 160, 230), (220, 220, 120))

_HORIZON_STEPS = 720
"""Corners of the horizon all around."""

_AHEAD = 0.5
"""Arrows of tracks lead to where the objects will be after this time [s]."""


def draw_overlay(
    image: Image,
    observation: Observation,
    objects: Sequence[Detection],
    rejected: Sequence[Detection],
    threshold: float,
    field: FieldFeatures | None,
) -> Image:
    """A copy of a BGR, BGRA or gray image with mesh points in the color of their class, objects with outline,
    confidence and distance, and the features of the field. threshold: a point above it belongs to a class.

    A tracked object also has its number and speed, and, if it moves, an arrow to where it will be after half a second.

    The paper's fig:ball_detection_images has such pictures; there, the colors are confidences.
    """
    colors = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 or image.shape[2] == 1 else image[:, :, :3]
    canvas = np.array(colors, dtype=np.uint8, order="C")
    scale = max(max(canvas.shape[:2]) / 1280.0, 0.8)
    _draw_points(canvas, observation, threshold)
    if field is not None:
        draw_field(canvas, field, observation.view, scale)
    drawn = [(each, OBJECT) for each in objects] + [(each, _REJECTED) for each in rejected]
    drawn = [(each, color) for each, color in drawn if np.abs(each.outline).max(initial=0.0) < FARTHEST]
    for each, color in reversed(drawn):
        _draw_outline(canvas, each, color, scale)
        _draw_arrow(canvas, each, observation.view, scale)
    labels = Labels(canvas, scale)
    for each, _ in drawn:
        labels.avoid(each.center, each.radius)
    for each, color in drawn:
        _label(labels, each, color)
    if field is not None:
        label_field(labels, field, observation.view)
    return canvas


def draw_horizon(canvas: Image, view: PreparedView) -> None:
    """Draw the horizon of the observation plane into a BGR image: where it should be if lens and pose are right."""
    azimuths = np.linspace(-np.pi, np.pi, _HORIZON_STEPS + 1)
    pixels = view.ray_pixels(np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros_like(azimuths)]))
    seen = np.asarray((np.abs(pixels) < FARTHEST).all(axis=1))  # false for NaN
    for run in np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(seen)) + 1):
        if seen[run[0]]:
            points = np.rint(pixels[run] * 16).astype(np.int32).reshape(-1, 1, 2)
            cv2.polylines(canvas, [points], False, INK, 3, cv2.LINE_AA, shift=4)
            cv2.polylines(canvas, [points], False, _HORIZON, 1, cv2.LINE_AA, shift=4)


def _draw_points(canvas: Image, observation: Observation, threshold: float) -> None:
    """Draw mesh points: crosses of five pixels for objects and uprights, single pixels for the rest."""
    pixels = np.rint(observation.pixels).astype(np.intp)
    _draw_pixels(canvas, pixels, _OTHER)
    areas = 0
    for column, each in enumerate(observation.manifest.classes):
        chosen = pixels[observation.probabilities[:, column] > threshold]
        if each.kind == "area":
            _draw_pixels(canvas, chosen, _AREAS[areas % len(_AREAS)])
            areas += 1
        elif each.kind != "background":
            for shift in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
                _draw_pixels(canvas, chosen + shift, OBJECT if each.kind == "object" else _UPRIGHT)


def _draw_pixels(canvas: Image, pixels: np.ndarray, color: Color) -> None:
    x = np.clip(pixels[:, 0], 0, canvas.shape[1] - 1)
    y = np.clip(pixels[:, 1], 0, canvas.shape[0] - 1)
    canvas[y, x] = color


def _draw_outline(canvas: Image, detection: Detection, color: Color, scale: float) -> None:
    thickness = max(1, round(2 * scale))
    points = np.rint(detection.outline * 16).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(canvas, [points], True, INK, thickness + 2, cv2.LINE_AA, shift=4)
    cv2.polylines(canvas, [points], True, color, thickness, cv2.LINE_AA, shift=4)


def _draw_arrow(canvas: Image, detection: Detection, view: PreparedView, scale: float) -> None:
    """Draw the motion of a tracked object, unless it may stand still."""
    track = detection.track
    if track is None or np.hypot(*track.velocity) < 2.0 * track.velocity_error:
        return
    places = np.array([track.position[:2], track.position_at(track.time + _AHEAD)[:2]])
    pixels = view.plane_pixels(places)
    if (np.abs(pixels) < FARTHEST).all():
        start, end = np.rint(pixels).astype(int).tolist()
        thickness = max(1, round(2 * scale))
        cv2.arrowedLine(canvas, start, end, INK, thickness + 2, cv2.LINE_AA, tipLength=0.2)
        cv2.arrowedLine(canvas, start, end, OBJECT, thickness, cv2.LINE_AA, tipLength=0.2)


def _label(labels: Labels, detection: Detection, color: Color) -> None:
    text = f"{detection.class_name} {detection.confidence:.2f}  {detection.distance:.2f} m"
    if detection.reason is not None:
        text = f"{detection.class_name}? {detection.confidence:.2f}"
    if detection.track is not None:
        text += f"  #{detection.track.id} {np.hypot(*detection.track.velocity):.1f} m/s"
    labels.write(text, detection.center, detection.radius, color)
