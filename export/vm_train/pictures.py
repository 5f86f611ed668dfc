"""A folder of training pictures: imageX.jpg or .png, maskX.png, lensX.yaml, as the reference and vm-synth have them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Image
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.lens_file import LensFile, read_lens_file

IMAGES = (".jpg", ".jpeg", ".png")

Labels = npt.NDArray[np.int8]
"""Positions of classes; UNLABELED where a mask says nothing."""

UNLABELED = -1

Color = tuple[int, int, int]


@dataclass(frozen=True)
class Classes:
    """Classes in order, each with the RGB colors that masks have for it. Transparent pixels are unlabeled.

    Raises InputError if two classes share a color, or there are fewer than two.
    """

    colors: Mapping[str, tuple[Color, ...]]

    def __post_init__(self) -> None:
        if len(self.colors) < 2:
            raise InputError(f"a network tells at least two classes apart, not {list(self.colors)}")
        owner: dict[Color, str] = {}
        for name, colors in self.colors.items():
            for color in colors:
                if color in owner:
                    raise InputError(f"classes {owner[color]} and {name} share the color {list(color)}")
                owner[color] = name

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.colors)

    def labels(self, mask: Image) -> Labels:
        """Labels (h, w) of a BGRA or BGR mask (h, w, 4 or 3).

        Raises InputError naming a color that no class has.
        """
        keys = _keys(mask[..., 2::-1])
        opaque = mask[..., 3] > 0 if mask.shape[2] == 4 else np.ones(mask.shape[:2], dtype=bool)
        labels = np.full(mask.shape[:2], UNLABELED, dtype=np.int8)
        known = ~opaque
        for number, colors in enumerate(self.colors.values()):
            for color in colors:
                here = opaque & (keys == _keys(np.array(color)))
                labels[here] = number
                known |= here
        if not known.all():
            strange = mask[~known][0]
            raise InputError(
                f"{np.count_nonzero(~known)} pixels of the mask have a color of no class, as {strange[2::-1].tolist()}"
            )
        return labels


def _keys(colors: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """A number for each RGB color (..., 3)."""
    return np.asarray(colors.astype(np.int64) @ (65536, 256, 1))


@dataclass(frozen=True)
class PictureFiles:
    """The files of one picture; X of their names is its number."""

    number: str
    image: Path
    mask: Path
    lens: Path


@dataclass(frozen=True)
class Picture:
    """One picture: BGR image (h, w, 3), labels (h, w), lens and orientation."""

    image: Image
    labels: Labels
    lens: LensFile


def find_pictures(folder: Path) -> list[PictureFiles]:
    """All pictures of a folder, by number. Raises InputError if there is none."""
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}")
    images = {
        path.stem.removeprefix("image"): path
        for path in sorted(folder.iterdir())
        if path.stem.startswith("image") and path.suffix.lower() in IMAGES
    }
    if not images:
        raise InputError(f"no pictures in {folder}: images are named imageX.jpg or imageX.png")
    return [
        PictureFiles(number, path, folder / f"mask{number}.png", folder / f"lens{number}.yaml")
        for number, path in sorted(images.items())
    ]


def read_picture(files: PictureFiles, classes: Classes) -> Picture:
    """Read a picture. Raises InputError naming the file and its fault."""
    image = _read(files.image, cv2.IMREAD_COLOR)
    mask = _read(files.mask, cv2.IMREAD_UNCHANGED)
    if mask.ndim != 3 or mask.dtype != np.uint8:
        raise InputError(f"{files.mask.name}: a mask is an RGB or RGBA picture of 8 bits")
    if mask.shape[:2] != image.shape[:2]:
        sizes = (f"{each.shape[1]} x {each.shape[0]}" for each in (mask, image))
        raise InputError(f"{files.mask.name}: {' px, but the image is '.join(sizes)} px")
    lens = read_lens_file(files.lens)
    if lens.orientation is None:
        raise InputError(f"{files.lens.name}: lacks Hoc, the camera's height and orientation")
    try:
        return Picture(image, classes.labels(mask), lens)
    except InputError as error:
        raise InputError(f"{files.mask.name}: {error}") from error


def _read(path: Path, how: int) -> Image:
    if not path.is_file():
        raise InputError(f"{path.name}: is missing")
    picture = cv2.imread(str(path), how)
    if picture is None:
        raise InputError(f"{path.name}: can't be read as a picture")
    return np.asarray(picture, dtype=np.uint8)


@dataclass
class Check:
    """What reading all pictures found: those that are good, faults by number, and pixels of each class."""

    good: list[PictureFiles] = field(default_factory=list)
    faults: dict[str, str] = field(default_factory=dict)
    pixels: dict[str, int] = field(default_factory=dict)
    sizes: dict[tuple[int, int], int] = field(default_factory=dict)
    lenses: dict[str, int] = field(default_factory=dict)

    @property
    def absent(self) -> list[str]:
        """Classes that no picture shows."""
        return [name for name, count in self.pixels.items() if count == 0]


def check_pictures(pictures: Sequence[PictureFiles], classes: Classes, report: Callable[[], None]) -> Check:
    """Read all pictures, count what they hold, and collect all faults instead of stopping at the first."""
    found = Check(pixels=dict.fromkeys(classes.names, 0))
    for files in pictures:
        try:
            picture = read_picture(files, classes)
        except VisualMeshError as error:
            found.faults[files.number] = str(error)
        else:
            found.good.append(files)
            counts = np.bincount(picture.labels[picture.labels >= 0], minlength=len(classes.names))
            for name, count in zip(classes.names, counts.tolist(), strict=True):
                found.pixels[name] += count
            height, width = picture.labels.shape
            found.sizes[width, height] = found.sizes.get((width, height), 0) + 1
            kind = type(picture.lens.lens).__name__.lower()
            found.lenses[kind] = found.lenses.get(kind, 0) + 1
        report()
    return found
