"""The contact sheet of vm-train preview: augmented pictures with mesh points, and each kind of augmentation alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import Field, fields, replace
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Image, Singles
from vm_embedded.errors import InputError
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.contact_sheet import GAP

from ..data.pictures import Picture
from ..graphs.augmentation import (
    Augmentation,
    Tone,
    apply_tone,
    perturb_camera,
    perturb_colors,
    perturb_sharpness,
    soften,
    with_camera_error,
)
from .preview_cells import CIRCLES, add_circles, cell, legend, middle, padded, point_colors, scaled, with_points

_DEVIATIONS = 2.0  # standard deviations to show of a camera error
_TRUE, _ASSUMED = (190, 190, 190), (255, 150, 0)  # RGB colors of circles


def sheet(
    pictures: Sequence[Picture],
    manifest: Manifest,
    grid: Grid,
    augmentation: Augmentation,
    seed: int,
    versions: int = 5,
    width: int = 320,
) -> Image:
    """A sheet (h, w, 3) BGR with a row for each picture: the original and `versions` augmented versions of it.

    Dots are the points of the network's mesh, in the colors of their classes; dense points are thinned out. The rows
    below show the first picture with one augmentation entry at a time, at both of its ends. The ends of camera errors
    are two standard deviations. width: of each image [px]. Raises InputError if there are no pictures, and if a lens
    does not fit its image or sees nothing of it.
    """
    if not pictures:
        raise InputError("there are no pictures to show")
    columns = versions + 1
    rows = [legend([each.name for each in manifest.classes], point_colors(manifest), columns * (width + GAP))]
    for number, picture in enumerate(pictures):
        cells = [cell(with_points(picture, manifest, grid, width), "original")]
        for version in range(versions):
            random = np.random.default_rng([seed, 3, version, number])
            perturbed = perturb_camera(picture, augmentation, random)
            soft = perturb_sharpness(perturbed, augmentation, random)
            made = _with_colors(soft, perturb_colors(_colors(soft.image), augmentation, random))
            cells.append(cell(with_points(made, manifest, grid, width), _camera_error(picture, perturbed)))
        rows.append(np.hstack(cells))
    alone = [_both_ends(pictures[0], entry, augmentation, seed, width) for entry in _switched_on(augmentation)]
    if alone:
        meters = ", ".join(f"{each:g}" for each in CIRCLES)
        names = [f"circles of {meters} m on the plane", "the same circles with the camera error"]
        rows.append(legend(names, [_TRUE, _ASSUMED], columns * (width + GAP)))
    rows += [np.hstack(alone[start : start + columns]) for start in range(0, len(alone), columns)]
    return np.vstack([padded(row, len(row), rows[0].shape[1]) for row in rows])


def _switched_on(augmentation: Augmentation) -> list[Field[Any]]:
    """Entries that have an effect, without the shares of pictures."""
    entries = [each for each in fields(augmentation) if not each.name.endswith("_share")]
    return [each for each in entries if getattr(augmentation, f"{each.name}_share", getattr(augmentation, each.name))]


def _both_ends(picture: Picture, entry: Field[Any], augmentation: Augmentation, seed: int, width: int) -> Image:
    """Two cells: a picture changed by one entry alone, at the lower and at the upper end of the entry."""
    cells = []
    for value in _ends(entry.name, getattr(augmentation, entry.name)):
        made = _changed(picture, entry.name, value, np.random.default_rng([seed, 4]))
        image = made.image
        if entry.name in ("noise", "blur", "jpeg"):  # a smaller picture would hide them
            image = middle(image, width)
        canvas = scaled(image, width)
        if made.lens is not picture.lens:
            for lens, color in ((picture.lens, _TRUE), (made.lens, _ASSUMED)):
                add_circles(canvas, lens, picture.image.shape, color)
        cells.append(cell(canvas, f"{entry.name} {value:.3g} {entry.metadata['unit']}"))
    return np.vstack(cells)


def _ends(name: str, entry: Any) -> tuple[float, float]:
    """The lower and the upper end of an entry of Augmentation."""
    match name:
        case "height" | "focal_length":
            return math.exp(-_DEVIATIONS * entry), math.exp(_DEVIATIONS * entry)
        case "tilt" | "center":
            return -_DEVIATIONS * entry, _DEVIATIONS * entry
        case "hue":
            return -entry, entry
        case "noise":
            return entry / 2.0, entry
        case "blur" | "jpeg":
            low, high = entry
            return low, high
    return 1.0 / (1.0 + entry), 1.0 + entry


def _changed(picture: Picture, name: str, value: float, random: np.random.Generator) -> Picture:
    """A picture with one change. name: of the entry in Augmentation."""
    match name:
        case "height":
            return with_camera_error(picture, height=value)
        case "focal_length":
            return with_camera_error(picture, focal_length=value)
        case "tilt":
            return with_camera_error(picture, tilt=(0.0, math.radians(value)))
        case "center":
            return with_camera_error(picture, center=(value, 0.0))
        case "blur":
            return replace(picture, image=soften(picture.image, blur=value))
        case "jpeg":
            return replace(picture, image=soften(picture.image, jpeg=round(value)))
    tone = replace(Tone(), **{name: value})
    return _with_colors(picture, apply_tone(_colors(picture.image), tone, random))


def _colors(image: Image) -> Singles:
    """Colors (h * w, 3), RGB from 0 to 1, of an image (h, w, 3) BGR."""
    return np.asarray(image[..., ::-1].reshape(-1, 3) / np.float32(255.0), dtype=np.float32)


def _with_colors(picture: Picture, colors: Singles) -> Picture:
    """The picture with colors (h * w, 3), RGB from 0 to 1."""
    levels = np.rint(colors * np.float32(255.0)).astype(np.uint8)
    return replace(picture, image=levels.reshape(picture.image.shape)[..., ::-1])


def _camera_error(picture: Picture, perturbed: Picture) -> str:
    """The camera error of a perturbed picture, as text."""
    true, other = picture.orientation, perturbed.orientation
    turn = cv2.Rodrigues(other.rotation @ true.rotation.T)[0]
    tilt = math.degrees(float(np.linalg.norm(turn)))
    return f"height {100.0 * (other.height / true.height - 1.0):+.1f} %, tilt {tilt:.1f} deg"
