"""A contact sheet of boxes: what lies in them, the most unusual ones first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.cameras.image_files import read_image
from vm_workstation.contact_sheet import FAINT_INK, GAP, INK, LINE, PAPER, Color, scaled_pixels, write_text

from .box import Box, BoxedPicture
from .checked_boxes import is_cut

_CELL, _COLUMNS = 112, 16
"""Width and height of a crop [px], and crops in a row."""

_AROUND = 2.0
"""Width and height of a crop, as a multiple of the box's longer side."""

_OUTLINE, _UNLABELED = (0, 220, 255), (60, 60, 255)
"""Colors of boxes, and of places without a box that look like an object (BGR)."""

Place = tuple[BoxedPicture, Box]


def unusual_first(pictures: Sequence[BoxedPicture], name: str) -> list[Place]:
    """The boxes of a class, each with its picture: first those whose size and proportions differ most from the others'.

    Proportions of boxes that the image's border cuts do not count.
    """
    places = [(picture, box) for picture in pictures for box in picture.boxes if box.name == name]
    if not places:
        return []
    sizes = [math.log(box.width * box.height) / 2.0 for _, box in places]
    shapes = [0.0 if is_cut(box, picture.size) else math.log(box.width / box.height) for picture, box in places]
    oddness = _deviations(sizes) + _deviations(shapes)
    return [places[index] for index in np.argsort(-oddness, kind="stable")]


def box_sheet(places: Sequence[Place], folder: Path, unlabeled: Sequence[Place] = ()) -> Image:
    """A sheet (h, w, 3) BGR with a crop around each box, its outline, its picture below the folder, and its size.

    places: at least one. unlabeled: places without a box that look like an object; they follow, in red. Raises
    InputError if an image can't be read.
    """
    found = _cells([*places, *unlabeled], folder, [_OUTLINE] * len(places) + [_UNLABELED] * len(unlabeled))
    cells = [cell for _, cell in sorted(found, key=lambda each: each[0])]
    empty = np.full_like(cells[0], PAPER[0])
    columns = min(_COLUMNS, len(cells))
    cells += [empty] * (-len(cells) % columns)
    rows = [np.hstack(cells[start : start + columns]) for start in range(0, len(cells), columns)]
    return np.vstack(rows)


def _cells(places: Sequence[Place], folder: Path, colors: Sequence[Color]) -> Iterator[tuple[int, Image]]:
    """The position and the cell of each box; each image is read once."""
    order = sorted(range(len(places)), key=lambda index: places[index][0].image)
    path, image = None, np.empty((0, 0, 3), dtype=np.uint8)
    for index in order:
        picture, box = places[index]
        if picture.image != path:
            path, image = picture.image, read_image(picture.image)
        lines = (str(picture.image.relative_to(folder).with_suffix("")), f"{box.width:.0f} x {box.height:.0f} px")
        yield index, _cell(_crop(image, box, colors[index]), lines)


def _cell(crop: Image, lines: tuple[str, str]) -> Image:
    cell = np.full((_CELL + 2 * LINE + GAP, _CELL + GAP, 3), PAPER[0], dtype=np.uint8)
    cell[:_CELL, :_CELL] = crop
    # The end of a long name tells more than its beginning.
    name = lines[0] if len(lines[0]) <= 16 else f"..{lines[0][-14:]}"
    write_text(cell[:, :_CELL], name, (0, _CELL + LINE - 4), FAINT_INK)
    write_text(cell[:, :_CELL], lines[1], (0, _CELL + 2 * LINE - 4), INK)
    return cell


def _crop(image: Image, box: Box, color: Color) -> Image:
    """A square around a box, scaled to the size of a cell, with the box's outline; gray outside of the image."""
    side = max(round(_AROUND * max(box.width, box.height)), 8)
    x, y = np.round(box.center + 0.5 - side / 2.0).tolist()
    shift = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]])
    cutout = cv2.warpAffine(image, shift, (side, side), flags=cv2.INTER_NEAREST, borderValue=PAPER)
    crop = cv2.resize(cutout, (_CELL, _CELL), interpolation=cv2.INTER_AREA if side > _CELL else cv2.INTER_LINEAR)
    edges = np.array([[box.left, box.top], [box.right, box.bottom]])
    (left, top), (right, bottom) = np.round(scaled_pixels(edges, (x, y), _CELL / side)).astype(int).tolist()
    cv2.rectangle(crop, (left, top), (right, bottom), color, 1)
    return np.asarray(crop, dtype=np.uint8)


def _deviations(values: Sequence[float]) -> Floats:
    """Distances from the median, as multiples of their own median."""
    distances = np.abs(np.array(values) - median(values))
    return np.asarray(distances / max(float(np.median(distances)), 1e-6))
