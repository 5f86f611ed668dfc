"""Contact sheets of a set: each picture, and below it a copy with tinted classes and the ball's true outline."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import GeometryError, InputError, one_line
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.shape import Shape
from vm_embedded.geometry.shapes import Cylinder, Sphere
from vm_workstation.contact_sheet import (
    FAINT_INK,
    GAP,
    INK,
    LINE,
    PAPER,
    check_sheet_size,
    draw_legend,
    scaled_pixels,
    write_text,
)
from vm_workstation.outlines import shape_outline

from .files import CLASS_COLORS, file_of, read_truth

OUTLINE = (255, 0, 255)
"""RGB color of the ball's true outline."""

_TINT, _CONTOUR = 0.16, 0.8  # opacity of a class's color on its area and on its rim
_SMALL = 1.0 / 20.0  # balls with a smaller radius, as a share of the tile's width, are magnified
_INSET = 0.3  # width of the magnified part, as a share of the tile's width


@dataclass(frozen=True)
class LabeledPicture:
    """A picture with its truth.

    image: (h, w, 3) BGR. mask: (h, w, 4) BGRA. truth: content of scene*.json. outlines: of the ball
    or the other objects to detect, each (n, 2) [px], NaN outside of the lens's field of view.
    """

    index: int
    image: Image
    mask: Image
    truth: dict[str, Any]
    outlines: tuple[Floats, ...]


def read_labeled(folder: Path, index: int) -> LabeledPicture:
    """Read a picture and compute the outlines of its objects. Raises InputError that names the invalid file."""
    image = read_image(file_of(folder, "image", index))
    mask = read_image(file_of(folder, "mask", index), raw=True)
    size = (image.shape[1], image.shape[0])
    if mask.shape != (*image.shape[:2], 4):
        raise InputError(f"{file_of(folder, 'mask', index)} must be a mask of {size[0]} x {size[1]} px with 4 channels")
    truth = read_truth(folder, index)
    lens_path = file_of(folder, "lens", index)
    lens = read_lens_file(lens_path)
    if lens.orientation is None:
        raise InputError(f"{lens_path} has no camera pose (Hoc)")
    try:
        found = tuple(
            shape_outline(lens.lens.for_image(size), lens.orientation, shape, center, size)
            for shape, center in _shapes(truth)
        )
        shown = LabeledPicture(index, image, mask, truth, found)
        captions(shown)
    except (KeyError, TypeError, ValueError, GeometryError) as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: {one_line(error)}") from error
    return shown


def object_name(truth: dict[str, Any]) -> str:
    """The class of the objects to detect in a scene."""
    return str(truth["object"]["name"]) if "object" in truth else "ball"


def _shapes(truth: dict[str, Any]) -> list[tuple[Shape, Floats]]:
    """Shape and center (3,) [m] of the ball, or of each of the other objects to detect."""
    shown = truth["objects"] if "object" in truth else [truth["ball"]] if truth["ball"] is not None else []
    return [
        (
            Cylinder(float(each["radius"]), float(each["height"]))
            if "height" in each
            else Sphere(float(each["radius"])),
            np.array(each["center"], dtype=np.float64).reshape(3),
        )
        for each in shown
    ]


def captions(shown: LabeledPicture) -> tuple[str, str]:
    """Two lines of text: the picture's number and map, and its ball or the number of its objects."""
    head = f"{shown.index}  {shown.truth['map']}"
    if "object" in shown.truth:
        return head, f"{len(shown.outlines)} of class {object_name(shown.truth)}"
    ball = shown.truth["ball"]
    if ball is None:
        return head, "no ball"
    about = f"{ball['distance']:.2f} m, radius {ball['pixel_radius']:.1f} px, {100.0 * ball['visible']:.0f} % visible"
    return head, about


def tinted(image: Image, mask: Image) -> Image:
    """A picture (h, w, 3) BGR with the colors of its classes: faint on areas, strong on their rims."""
    found = image.astype(np.float32)
    for name, color in CLASS_COLORS.items():
        if name == "environment":
            continue
        paint = np.array(color[::-1], dtype=np.float32)
        area = ((mask[..., :3] == paint.astype(np.uint8)).all(axis=-1) & (mask[..., 3] > 0)).astype(np.uint8)
        rim = area - cv2.erode(area, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
        if name in ("ball", "field"):
            rim[:] = 0  # the ball gets its outline; the rim of the field is that of its neighbors
        strength = np.where(rim > 0, _CONTOUR, _TINT * area)[..., None].astype(np.float32)
        found += strength * (paint - found)
    return np.rint(found).astype(np.uint8)


def cell(shown: LabeledPicture, width: int) -> Image:
    """The cell of a picture (h, width, 3): the picture, a copy with its truth, and two lines of text."""
    height, full = shown.image.shape[:2]
    zoom = width / full
    size = (width, max(round(height * zoom), 1))
    how = cv2.INTER_AREA if zoom < 1.0 else cv2.INTER_LINEAR
    upper = cv2.resize(shown.image, size, interpolation=how)
    lower = np.asarray(cv2.resize(tinted(shown.image, shown.mask), size, interpolation=how), dtype=np.uint8)
    for outline in shown.outlines:
        _draw_outline(lower, scaled_pixels(outline, (0.0, 0.0), zoom))
    if len(shown.outlines) == 1:
        _add_inset(lower, shown, zoom)
    text = np.full((2 * LINE + 4, width, 3), PAPER, dtype=np.uint8)
    for row, (line, color) in enumerate(zip(captions(shown), (INK, FAINT_INK), strict=True)):
        write_text(text, line, (2, (row + 1) * LINE - 3), color)
    seam = np.full((1, width, 3), PAPER, dtype=np.uint8)
    return np.vstack([upper, seam, lower, text])


def _draw_outline(canvas: Image, pixels: Floats) -> None:
    limit = 2.0 * max(canvas.shape[:2])
    points = np.rint(np.clip(pixels, -limit, 2.0 * limit) * 16.0)
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        if np.isfinite(start).all() and np.isfinite(end).all():
            first, last = ((int(x), int(y)) for x, y in (start, end))
            cv2.line(canvas, first, last, OUTLINE[::-1], 1, cv2.LINE_AA, shift=4)


def _add_inset(canvas: Image, shown: LabeledPicture, zoom: float) -> None:
    """Draw a magnified cutout of a single small object, without tints, in the farthest corner."""
    (outline,) = shown.outlines
    pixels = outline[np.isfinite(outline).all(axis=1)]
    height, width = canvas.shape[:2]
    side = min(round(_INSET * width), height // 2)
    if not len(pixels):
        return
    middle, reach = (pixels.min(axis=0) + pixels.max(axis=0)) / 2.0, float(np.ptp(pixels, axis=0).max())
    if reach * zoom > 2.0 * _SMALL * width:
        return
    span = max(2.2 * reach, 8.0)
    corner = (float(middle[0] + 0.5 - span / 2.0), float(middle[1] + 0.5 - span / 2.0))
    scale = side / span
    shift = [0.5 * scale - 0.5 - corner[0] * scale, 0.5 * scale - 0.5 - corner[1] * scale]
    matrix = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
    inset = np.asarray(
        cv2.warpAffine(shown.image, matrix, (side, side), flags=cv2.INTER_NEAREST, borderValue=PAPER), dtype=np.uint8
    )
    _draw_outline(inset, scaled_pixels(outline, corner, scale))
    inset[[0, -1]] = inset[:, [0, -1]] = INK
    left = 0 if middle[0] * zoom > width / 2.0 else width - side
    top = 0 if middle[1] * zoom > height / 2.0 else height - side
    canvas[top : top + side, left : left + side] = inset


def sheet(cells: Sequence[Image], columns: int, title: str, object_name: str = "ball") -> Image:
    """Cells of one size (h, w, 3) in rows below a title and a legend. Raises InputError if the sheet is too large.

    object_name: class of the objects to detect.
    """
    height, width = cells[0].shape[:2]
    columns = min(columns, len(cells))
    rows = math.ceil(len(cells) / columns)
    head = LINE + 2 * GAP
    size = (head + rows * (height + GAP), GAP + columns * (width + GAP))
    check_sheet_size(size[1], size[0])
    canvas = np.full((*size, 3), PAPER, dtype=np.uint8)
    place = GAP + write_text(canvas, title, (GAP, head - GAP - 3), INK) + 3 * GAP
    legend = {name: CLASS_COLORS[name] for name in ("field", "line", "goal", "robot")}
    draw_legend(canvas, {**legend, object_name: CLASS_COLORS["ball"], "true outline": OUTLINE}, (place, head - GAP - 3))
    for number, each in enumerate(cells):
        row, column = divmod(number, columns)
        top, left = head + row * (height + GAP), GAP + column * (width + GAP)
        canvas[top : top + height, left : left + width] = each
    return canvas
