"""Boxes around the balls of a data set of vm-synth, as files that other detectors learn from.

OUT/images/PART and OUT/labels/PART hold the pictures, as links, and for each a text file. A line of it is a ball: class
0, then the center, width and height of its box as shares of the picture. Parts are `training` and `validation`, the
same ones that vm-train uses. OUT/data.yaml names the folders for the trainer of YOLO.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import read_model
from vm_train.data.classes import Classes
from vm_train.data.picture_files import PictureFiles
from vm_train.data.pictures import Picture, find_pictures, read_picture
from vm_train.data.split import split_by_seed
from vm_train.scores.object_scores import MIN_VISIBLE
from vm_train.scores.overlaps import TrueObject
from vm_train.truth.objects import read_scene, true_objects

from ..shipped import classes_of

PARTS = ("training", "validation")
VALIDATION, SEED = 0.05, 0
"""Share of the pictures for validation, and the seed of the split, as in export/networks/ball.toml."""

MIN_RADIUS = 1.5
"""A smaller ball gets no box [px]."""


LENSES = ("rectilinear", "fisheye")
"""Kinds of lenses."""


def kind_of_lens(files: PictureFiles) -> str:
    """`rectilinear` or `fisheye`."""
    return LENSES[0] if "RECTILINEAR" in files.lens.read_text() else LENSES[1]


def link_pictures(data: Path, out: Path, lens: str) -> None:
    """Link the files of all pictures with a kind of lens into a folder; links that are there stay."""
    out.mkdir(parents=True, exist_ok=True)
    for files in find_pictures(data):
        if kind_of_lens(files) == lens:
            for path in (files.image, files.mask, files.lens, files.image.with_name(f"scene{files.number}.json")):
                link = out / path.name
                if not link.is_symlink():
                    link.symlink_to(path.resolve())


def read_truths(files: PictureFiles, classes: Classes) -> tuple[Picture, float, list[TrueObject]]:
    """A picture, the radius of its ball [m], and its balls. Raises PictureFault."""
    picture = read_picture(files, classes)
    scene = read_scene(files.image.with_name(f"scene{files.number}.json"))
    assert scene is not None
    return picture, scene.radius, true_objects(picture, scene, _manifest())["ball"]


@cache
def _manifest() -> Manifest:
    return read_model(model_path(DEFAULT)).manifest


def box_of(ball: TrueObject) -> Floats:
    """Left, top, right and bottom (4,) of a ball in the picture [px], also of its hidden parts.

    The scores count the whole outline, so a detector that learned only visible parts would be at a disadvantage.
    """
    y, x = np.nonzero(ball.mask >= 0.5)
    return np.array([x.min(), y.min(), x.max() + 1.0, y.max() + 1.0]) if len(x) else np.zeros(4)


def _lines(picture: Picture, balls: Sequence[TrueObject]) -> list[str]:
    height, width = picture.labels.shape
    found = []
    for ball in balls:
        left, top, right, bottom = box_of(ball) / (width, height, width, height)
        if not ball.is_ignored(MIN_VISIBLE, MIN_RADIUS) and right > left:
            box = ((left + right) / 2.0, (top + bottom) / 2.0, right - left, bottom - top)
            found.append("0 " + " ".join(f"{value:.6f}" for value in box))
    return found


def read_boxes(path: Path, width: int, height: int) -> Floats:
    """Left, top, right and bottom (n, 4) [px] in a text file of labels."""
    values = np.array([line.split()[1:] for line in path.read_text().splitlines()], dtype=np.float64).reshape(-1, 4)
    corners = np.concatenate([values[:, :2] - values[:, 2:] / 2.0, values[:, :2] + values[:, 2:] / 2.0], axis=1)
    return np.asarray(corners * (width, height, width, height))


def write_boxes(data: Path, out: Path) -> None:
    """Write the folders of both parts for a data set; files that are there stay."""
    classes = classes_of(model_path(DEFAULT))
    pictures = {each.number: each for each in find_pictures(data)}
    split = split_by_seed(list(pictures), VALIDATION, 0.0, SEED)
    for part in PARTS:
        for kind in ("images", "labels"):
            (out / kind / part).mkdir(parents=True, exist_ok=True)
        for number in getattr(split, part):
            label = out / "labels" / part / f"{number}.txt"
            if label.exists():
                continue
            picture, _, balls = read_truths(pictures[number], classes)
            link = out / "images" / part / f"{number}{pictures[number].image.suffix}"
            if link.is_symlink():
                link.unlink()
            link.symlink_to(pictures[number].image.resolve())
            label.write_text("".join(line + "\n" for line in _lines(picture, balls)))
    (out / "data.yaml").write_text(
        f"path: {out.resolve()}\ntrain: images/training\nval: images/validation\nnames:\n  0: ball\n"
    )
