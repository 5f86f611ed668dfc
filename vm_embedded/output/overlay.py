"""Drawing mesh points and detections into images."""

from __future__ import annotations

import cv2
import numpy as np

from ..arrays import Floats, Image
from ..detection.detections import Detection, Detections

_Color = tuple[int, int, int]

# Colors are BGR. Objects stand out; classes that cover areas are pale.
_OBJECT, _REJECTED, _INK = (60, 220, 255), (90, 90, 255), (30, 30, 30)
_UPRIGHT, _OTHER = (255, 120, 60), (140, 140, 140)
_AREAS = ((255, 255, 255), (190, 255, 170), (230, 160, 230), (220, 220, 120))


def draw_overlay(image: Image, detections: Detections) -> Image:
    """A copy of a BGR, BGRA or gray image with mesh points in the color of their class, and objects with outline,
    confidence and distance.

    The paper's fig:ball_detection_images has such pictures; there, the colors are confidences.
    """
    colors = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image[:, :, :3]
    canvas = np.array(colors, dtype=np.uint8, order="C")
    scale = max(max(canvas.shape[:2]) / 1280.0, 0.8)
    _draw_points(canvas, detections)
    for each in detections.rejected:
        _draw_object(canvas, each, _REJECTED, scale)
    for each in detections.objects:
        _draw_object(canvas, each, _OBJECT, scale)
    return canvas


def _draw_points(canvas: Image, detections: Detections) -> None:
    """Draw mesh points: crosses of five pixels for objects and uprights, single pixels for the rest."""
    pixels = np.rint(detections.pixels).astype(np.intp)
    _draw_pixels(canvas, pixels, _OTHER)
    areas = 0
    for column, each in enumerate(detections.manifest.classes):
        chosen = pixels[detections.probabilities[:, column] > detections.threshold]
        if each.kind == "area":
            _draw_pixels(canvas, chosen, _AREAS[areas % len(_AREAS)])
            areas += 1
        elif each.kind != "background":
            for shift in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
                _draw_pixels(canvas, chosen + shift, _OBJECT if each.kind == "object" else _UPRIGHT)


def _draw_pixels(canvas: Image, pixels: np.ndarray, color: _Color) -> None:
    x = np.clip(pixels[:, 0], 0, canvas.shape[1] - 1)
    y = np.clip(pixels[:, 1], 0, canvas.shape[0] - 1)
    canvas[y, x] = color


def _draw_object(canvas: Image, detection: Detection, color: _Color, scale: float) -> None:
    if np.abs(detection.outline).max(initial=0.0) > 1e4:  # OpenCV cannot draw so far outside
        return
    thickness = max(1, round(2 * scale))
    points = np.rint(detection.outline * 16).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(canvas, [points], True, _INK, thickness + 2, cv2.LINE_AA, shift=4)
    cv2.polylines(canvas, [points], True, color, thickness, cv2.LINE_AA, shift=4)
    text = f"{detection.class_name} {detection.confidence:.2f}  {detection.distance:.2f} m"
    if detection.reason is not None:
        text = f"{detection.class_name}? {detection.confidence:.2f}"
    _draw_label(canvas, text, detection.center, detection.radius, color, scale)


def _draw_label(canvas: Image, text: str, center: Floats, radius: float, color: _Color, scale: float) -> None:
    """Write a line of text beside an object, inside the image."""
    font, size, thickness = cv2.FONT_HERSHEY_SIMPLEX, 0.6 * scale, max(1, round(1.5 * scale))
    (width, height), base = cv2.getTextSize(text, font, size, thickness)
    pad = round(4 * scale)
    x = center[0] + radius + 3 * pad
    if x + width + pad > canvas.shape[1]:
        x = center[0] - radius - 3 * pad - width
    left = int(np.clip(x, pad, max(canvas.shape[1] - width - pad, pad)))
    bottom = int(np.clip(center[1] + height / 2, height + pad, canvas.shape[0] - base - pad))
    cv2.rectangle(canvas, (left - pad, bottom - height - pad), (left + width + pad, bottom + base), _INK, cv2.FILLED)
    cv2.putText(canvas, text, (left, bottom), font, size, color, thickness, cv2.LINE_AA)
