"""Cells of a preview: a picture with mesh points or circles on the plane, and a line of text below it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Image
from vm_embedded.errors import GeometryError
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.contact_sheet import GAP, INK, LINE, PAPER, draw_legend, scaled_pixels, write_text

from ..data.classes import Color
from ..data.pictures import Picture
from ..graphs.seen_points import seen_points

CIRCLES = (1.0, 2.0, 4.0, 8.0)
"""Radii of circles around the camera's foot [m]."""

_BACKGROUND = (150, 150, 150)
_PALETTE = (
    (255, 40, 40),
    (255, 230, 0),
    (255, 255, 255),
    (0, 230, 70),
    (60, 130, 255),
    (255, 80, 255),
    (0, 230, 230),
    (255, 150, 0),
)
"""RGB colors of all other classes, in order. Colors of masks could be as dark as the picture."""

_STRENGTH = 0.7  # opacity of a point
_SPACING = 4  # side of a square of the sheet that shows one point of each class [px]
_CROSS = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))


def scaled(image: Image, width: int) -> Image:
    """A copy of an image, scaled to a width [px]."""
    height, full = image.shape[:2]
    how = cv2.INTER_AREA if width < full else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, max(round(height * width / full), 1)), interpolation=how))


def middle(image: Image, width: int) -> Image:
    """The middle of an image: at most `width` wide [px], with the proportions of the image."""
    height, full = image.shape[:2]
    columns = min(width, full)
    rows = max(round(height * columns / full), 1)
    top, left = (height - rows) // 2, (full - columns) // 2
    return image[top : top + rows, left : left + columns]


def with_points(picture: Picture, manifest: Manifest, grid: Grid, width: int) -> Image:
    """A picture, scaled to a width [px], with the network's mesh points; without points if the camera is too low."""
    canvas = scaled(picture.image, width)
    try:
        pixels = seen_points(picture.lens, picture.size, manifest, grid).pixels
    except GeometryError:
        return canvas
    columns, rows = np.rint(pixels).astype(np.intp).T
    x, y = _places(pixels, picture.size[0], canvas)
    labels = picture.labels[rows, columns]
    first = np.unique(np.stack([x // _SPACING, y // _SPACING, labels]), axis=1, return_index=True)[1]
    x, y, labels = x[first], y[first], labels[first]
    for column, (each, color) in enumerate(zip(manifest.classes, point_colors(manifest), strict=True)):
        here = labels == column
        for right, down in _CROSS if each.kind == "object" else _CROSS[:1]:
            _dot(canvas, x[here] + right, y[here] + down, color)
    return canvas


def _dot(canvas: Image, x: npt.NDArray[np.intp], y: npt.NDArray[np.intp], color: Color) -> None:
    inside = (x >= 0) & (x < canvas.shape[1]) & (y >= 0) & (y < canvas.shape[0])
    x, y = x[inside], y[inside]
    found = canvas[y, x] * (1.0 - _STRENGTH) + np.array(color[::-1]) * _STRENGTH
    canvas[y, x] = np.rint(found).astype(np.uint8)


def add_circles(canvas: Image, lens: LensFile, shape: tuple[int, ...], color: Color) -> None:
    """Draw circles on the plane around the camera's foot. shape: of the camera's images, (h, w, 3)."""
    assert lens.orientation is not None
    size = (shape[1], shape[0])
    around = np.linspace(0.0, 2.0 * math.pi, 2000)
    circle = np.stack([np.cos(around), np.sin(around), np.zeros_like(around)], axis=1)
    rays = np.concatenate([radius * circle for radius in CIRCLES]) - (0.0, 0.0, lens.orientation.height)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ lens.orientation.rotation
    fitted = lens.lens.for_image(size)
    pixels = fitted.project(rays, size)[fitted.sees(rays)]
    inside = ((pixels >= 0.0) & (pixels <= np.array(size) - 1.0)).all(axis=1)
    x, y = _places(pixels[inside], size[0], canvas)
    canvas[y, x] = color[::-1]


def _places(pixels: Floats, full: int, canvas: Image) -> npt.NDArray[np.intp]:
    """Columns and rows (2, n) in a canvas of pixels (n, 2) in an image of width `full` [px]."""
    x, y = np.rint(scaled_pixels(pixels, (0.0, 0.0), canvas.shape[1] / full)).astype(np.intp).T
    return np.stack([np.clip(x, 0, canvas.shape[1] - 1), np.clip(y, 0, canvas.shape[0] - 1)])


def cell(image: Image, caption: str) -> Image:
    """An image above a line of text, with a gap to its right."""
    text = np.full((LINE + 4, image.shape[1], 3), PAPER, dtype=np.uint8)
    write_text(text, caption, (2, LINE - 3), INK)
    return padded(np.vstack([image, text]), len(image) + len(text), image.shape[1] + GAP)


def point_colors(manifest: Manifest) -> list[Color]:
    """The RGB color of each class's points."""
    colors: list[Color] = []
    for each in manifest.classes:
        shown = len(colors) - colors.count(_BACKGROUND)
        colors.append(_BACKGROUND if each.kind == "background" else _PALETTE[shown % len(_PALETTE)])
    return colors


def legend(names: Sequence[str], colors: Sequence[Color], width: int) -> Image:
    """A line of text with the meaning of colors."""
    line = np.full((LINE + 2 * GAP, width, 3), PAPER, dtype=np.uint8)
    draw_legend(line, dict(zip(names, colors, strict=True)), (GAP, len(line) - GAP - 3))
    return line


def padded(image: Image, height: int, width: int) -> Image:
    """The image with background to its right and below it."""
    below, right = height - image.shape[0], width - image.shape[1]
    return np.asarray(cv2.copyMakeBorder(image, 0, below, 0, right, cv2.BORDER_CONSTANT, value=PAPER), dtype=np.uint8)
