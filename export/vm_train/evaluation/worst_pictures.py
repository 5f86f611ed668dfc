"""Small pictures of the worst errors: the whole picture, and beside it the missed or false object, enlarged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image
from vm_embedded.cameras.decoding import decode

from .worst_errors import WorstError, WorstErrors

TRUE, FOUND = (120, 255, 60), (255, 60, 255)
"""BGR colors of true and found outlines."""

KEY = '<p>Outlines: <b class="true">true</b>, <b class="found">found</b>.</p>'
"""What their colors mean, for a page."""

_HEIGHT = 200  # of the small picture [px]
_AROUND = 4.0  # radii to show around the object
_LEAST = 24.0  # px to show around the object at least, so that people recognize it
_QUALITY = 85  # of the small JPEG pictures
_ROUND = 4  # fractional bits of corners in OpenCV


def error_strips(worst: WorstErrors) -> Mapping[str, list[tuple[bytes, str]]]:
    """The worst errors by heading: small JPEG pictures with their captions."""
    return {
        "Missed objects, the largest first": list(_captioned(worst.missed, "of {:.1f} px")),
        "False objects, the most confident first": list(_captioned(worst.false, "{:.2f}")),
    }


def _captioned(errors: Iterable[WorstError], rank: str) -> Iterable[tuple[bytes, str]]:
    for each in errors:
        jpeg = cv2.imencode(".jpg", draw_error(each), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
        yield jpeg, f"{each.image.name}: {each.class_name} {rank.format(each.rank)}"


def draw_error(error: WorstError) -> Image:
    """The picture (200, w, 3) with all outlines. Raises InputError if the image can no longer be read."""
    image = decode(error.content())
    height, width = image.shape[:2]
    scale = _HEIGHT / height
    whole = np.array([[scale, 0.0, 0.5 * scale - 0.5], [0.0, scale, 0.5 * scale - 0.5]])
    reach = min(max(_AROUND * error.radius, _LEAST), min(height, width) / 2.0)
    zoom = _HEIGHT / (2.0 * reach)
    # The enlarged part stays inside the picture, even if the object is at the border or beyond.
    x, y = np.clip(error.center, reach - 0.5, (width - reach - 0.5, height - reach - 0.5)).tolist()
    near = np.array([[zoom, 0.0, _HEIGHT / 2.0 - 0.5 - zoom * x], [0.0, zoom, _HEIGHT / 2.0 - 0.5 - zoom * y]])
    small = cv2.resize(image, (round(width * scale), _HEIGHT), interpolation=cv2.INTER_AREA)
    close = cv2.warpAffine(image, near, (_HEIGHT, _HEIGHT), flags=cv2.INTER_LINEAR)
    gap = np.full((_HEIGHT, 3, 3), 255, dtype=np.uint8)
    return np.hstack([_with_outlines(small, whole, error), gap, _with_outlines(close, near, error)])


def _with_outlines(picture: npt.NDArray[Any], view: Floats, error: WorstError) -> Image:
    canvas = np.array(picture, dtype=np.uint8)
    for outlines, color in ((error.true, TRUE), (error.found, FOUND)):
        cv2.polylines(canvas, _corners(outlines, view), True, color, 1, cv2.LINE_AA, shift=_ROUND)
    return canvas


def _corners(outlines: Sequence[Floats], view: Floats) -> list[npt.NDArray[np.int32]]:
    """Outlines in the form that OpenCV draws, without those that are too large for it."""
    placed = [each @ view[:, :2].T + view[:, 2] for each in outlines if len(each)]
    return [np.rint(each * 2**_ROUND).astype(np.int32) for each in placed if np.abs(each).max(initial=0.0) < 1e5]
