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
from vm_embedded.errors import InputError, VisualMeshError, one_line
from vm_embedded.geometry.lens_files import read_lens_file
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
from vm_workstation.sphere_outline import sphere_outline

from .files import CLASS_COLORS, file_of, read_truth

OUTLINE = (255, 0, 255)
"""RGB color of the ball's true outline."""

_TINT, _CONTOUR = 0.16, 0.8  # opacity of a class's color on its area and on its rim
_SMALL = 1.0 / 20.0  # balls with a smaller radius, as a share of the tile's width, are magnified
_INSET = 0.3  # width of the magnified part, as a share of the tile's width


@dataclass(frozen=True)
class LabeledPicture:
    """A picture with its truth.

    image: (h, w, 3) BGR. mask: (h, w, 4) BGRA. truth: content of scene*.json. outline: of the ball (n, 2) [px], NaN
    outside of the lens's field of view, or None without a ball.
    """

    index: int
    image: Image
    mask: Image
    truth: dict[str, Any]
    outline: Floats | None


def read_labeled(folder: Path, index: int) -> LabeledPicture:
    """Read a picture and compute its ball's outline. Raises InputError that names the invalid file."""
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
        ball = truth["ball"]
        found = None
        if ball is not None:
            center, radius = np.array(ball["center"], dtype=np.float64), float(ball["radius"])
            found = sphere_outline(lens.lens.for_image(size), lens.orientation, center, radius, size)
        shown = LabeledPicture(index, image, mask, truth, found)
        captions(shown)
    except VisualMeshError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{file_of(folder, 'scene', index)} is damaged: {one_line(error)}") from error
    return shown


def captions(shown: LabeledPicture) -> tuple[str, str]:
    """Two lines of text: the picture's number and map, and its ball."""
    ball = shown.truth["ball"]
    head = f"{shown.index}  {shown.truth['map']}"
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
    if shown.outline is not None:
        _draw_outline(lower, scaled_pixels(shown.outline, (0.0, 0.0), zoom))
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
    """Draw a magnified cutout of a small ball, without tints, in the farthest corner."""
    assert shown.outline is not None
    pixels = shown.outline[np.isfinite(shown.outline).all(axis=1)]
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
    _draw_outline(inset, scaled_pixels(shown.outline, corner, scale))
    inset[[0, -1]] = inset[:, [0, -1]] = INK
    left = 0 if middle[0] * zoom > width / 2.0 else width - side
    top = 0 if middle[1] * zoom > height / 2.0 else height - side
    canvas[top : top + side, left : left + side] = inset


def sheet(cells: Sequence[Image], columns: int, title: str) -> Image:
    """Cells of one size (h, w, 3) in rows below a title and a legend. Raises InputError if the sheet is too large."""
    height, width = cells[0].shape[:2]
    columns = min(columns, len(cells))
    rows = math.ceil(len(cells) / columns)
    head = LINE + 2 * GAP
    size = (head + rows * (height + GAP), GAP + columns * (width + GAP))
    check_sheet_size(size[1], size[0])
    canvas = np.full((*size, 3), PAPER, dtype=np.uint8)
    place = GAP + write_text(canvas, title, (GAP, head - GAP - 3), INK) + 3 * GAP
    legend = {name: CLASS_COLORS[name] for name in ("field", "line", "goal", "robot", "ball")}
    draw_legend(canvas, {**legend, "true outline of the ball": OUTLINE}, (place, head - GAP - 3))
    for number, each in enumerate(cells):
        row, column = divmod(number, columns)
        top, left = head + row * (height + GAP), GAP + column * (width + GAP)
        canvas[top : top + height, left : left + width] = each
    return canvas
