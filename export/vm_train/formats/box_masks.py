"""Masks from boxes: with lens and pose, the plane tells where in a box the object must be.

The object that stands on the plane in the direction of a box has an outline. Pixels inside both outline and box are
labeled as the object. Those in only one of them, and a margin, stay unlabeled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image, Mask
from vm_embedded.errors import GeometryError
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.shape import Shape
from vm_embedded.geometry.shapes import Sphere

from ..boxes.box import Box, BoxedPicture
from ..boxes.whole import cut_edges, whole_object
from ..data.classes import Color

_LARGEST_FACTOR, _SLACK = 1.5, 4.0
"""Largest ratio of the widths, or of the heights, of a box and the object on the plane, and what they may differ in
addition [px]: boxes drawn by hand are often too large by some pixels."""

_MARGIN = 0.05
"""Width of the unlabeled margin on both sides of an edge, as a share of the box's size; one pixel is added."""

_REFINEMENTS = 4
"""Steps that move the object until the middle of its outline is in the middle of the box."""


@dataclass(frozen=True, eq=False)
class MaskRule:
    """How boxes become masks.

    shape: of the objects. colors: RGB color in masks of each class of boxes to label. background: RGB color of
    everything outside of these boxes; None leaves it unlabeled.
    """

    shape: Shape
    colors: Mapping[str, Color]
    background: Color | None


class MisfitError(GeometryError):
    """An object on the plane does not fit a box."""


def mask_of(picture: BoxedPicture, lens_file: LensFile, rule: MaskRule) -> tuple[Image, int, list[str]]:
    """The mask (h, w, 4) of a picture as BGRA, the number of labeled boxes, and a line for each other box to label.

    lens_file: of the picture, with an orientation.
    """
    size, orientation = picture.size, lens_file.orientation
    assert orientation is not None
    lens = lens_file.lens.for_image(size)
    mask = np.zeros((size[1], size[0], 4), dtype=np.uint8)
    if rule.background is not None:
        mask[:] = _bgra(rule.background)
    insides, misfits = [], []
    for box in (each for each in picture.boxes if each.name in rule.colors):
        shown = _rectangle(box, size)
        outside, inside = shown, None
        try:
            outline = _filled(outline_in(box, size, lens, orientation, rule.shape), size)
            outside, inside = shown | outline, _possible(box, size, rule.shape) & outline
        except MisfitError as error:
            misfits.append(f"{_described(box)} {error}; left unlabeled")
        margin = 1 + int(_MARGIN * max(box.width, box.height))
        mask[_grown(outside, margin)] = 0
        if inside is not None:
            insides.append((~_grown(~inside, margin), rule.colors[box.name]))
    for pixels, color in insides:  # after all margins, which may reach into a neighboring object
        mask[pixels] = _bgra(color)
    return mask, len(insides), misfits


def outline_in(box: Box, size: Size, lens: Lens, orientation: Orientation, shape: Shape) -> Floats:
    """The outline of the object on the plane whose middle is that of a box, as pixels (n, 2).

    lens: for pictures of this width and height [px]. Raises MisfitError if there is none of about the box's size.
    """
    is_round = isinstance(shape, Sphere)
    if any(cut_edges(box, size)) and not is_round:
        raise MisfitError("is cut by the border of the picture")
    x, y, radius = whole_object(box, size, is_round)
    middle, place = np.array([x, y]), np.array([x, y])
    for _ in range(_REFINEMENTS):
        outline = _outline_at(place, size, lens, orientation, shape)
        low, high = outline.min(axis=0), outline.max(axis=0)
        place = place + middle - (low + high) / 2.0
    expected = high - low
    given = np.array([box.width, box.height])
    if any(cut_edges(box, size)):
        given[:] = 2.0 * radius
    larger, smaller = np.maximum(given, expected), np.minimum(given, expected)
    if not (larger <= _LARGEST_FACTOR * smaller + _SLACK).all():
        raise MisfitError(
            f"has {_by(given)} px, but an object on the plane there has {_by(expected)} px; is it above the plane, or "
            "partly hidden?"
        )
    return outline


def _outline_at(pixel: Floats, size: Size, lens: Lens, orientation: Orientation, shape: Shape) -> Floats:
    """The outline (n, 2) [px] of the object on the plane in the direction of a pixel (2,). Raises MisfitError."""
    ray = lens.unproject(pixel[None], size) @ orientation.rotation.T
    if not np.isfinite(ray).all() or ray[0, 2] >= 0.0:
        raise MisfitError("is not below the horizon")
    center = shape.center_along(ray, orientation.height)[0]
    if center[2] >= 0.0 or np.linalg.norm(center) <= shape.radius:
        raise MisfitError(f"shows an object that is too high for a camera at {orientation.height:.2f} m")
    rays = shape.outline(center, orientation.height) @ orientation.rotation
    if not lens.sees(rays).all():
        raise MisfitError("shows an object that reaches beyond the lens's field of view")
    return lens.project(rays, size)


def _filled(outline: Floats, size: Size) -> Mask:
    """The pixels (h, w) inside an outline (n, 2)."""
    found = np.zeros((size[1], size[0]), dtype=np.uint8)
    cv2.fillPoly(found, [np.rint(outline * 16.0).astype(np.int32)], 1, shift=4)
    return found.astype(bool)


def _rectangle(box: Box, size: Size) -> Mask:
    """The pixels (h, w) whose centers are inside a box."""
    columns, rows = np.arange(size[0]), np.arange(size[1])[:, None]
    across = (columns >= box.left) & (columns <= box.right)
    return np.asarray(across & (rows >= box.top) & (rows <= box.bottom))


def _possible(box: Box, size: Size, shape: Shape) -> Mask:
    """The pixels (h, w) that an object in a box may have: a ball in full view has none in the box's corners."""
    if any(cut_edges(box, size)) or not isinstance(shape, Sphere):
        return _rectangle(box, size)
    columns, rows = np.arange(size[0]), np.arange(size[1])[:, None]
    (x, y), across, down = box.center, (box.right - box.left) / 2.0, (box.bottom - box.top) / 2.0
    return np.asarray(((columns - x) / across) ** 2 + ((rows - y) / down) ** 2 <= 1.0)


def _grown(pixels: Mask, margin: int) -> Mask:
    """Pixels (h, w) and all others that are at most `margin` rows and columns away from one of them."""
    square = np.ones((2 * margin + 1, 2 * margin + 1), dtype=np.uint8)
    return np.asarray(cv2.dilate(pixels.astype(np.uint8), square).astype(bool))


def _bgra(color: Color) -> tuple[int, int, int, int]:
    red, green, blue = color
    return blue, green, red, 255


def _described(box: Box) -> str:
    return f"the box of {box.name} at ({box.center[0]:.0f}, {box.center[1]:.0f})"


def _by(size: Floats) -> str:
    return f"{size[0]:.1f} x {size[1]:.1f}"
