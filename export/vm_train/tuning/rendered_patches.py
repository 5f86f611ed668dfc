"""Rendered patches that a fine-tuning learns from besides the user's own, so that the network forgets little.

They are a sample of those that the look of the package learned from, in one small file: pictures of 32 x 32 patches
each, compressed as WebP. `make networks` writes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.cameras.decoding import decode
from vm_embedded.errors import InputError, one_line
from vm_embedded.files import atomic_write

from ..data.array_files import read_arrays
from ..look.patch_set import PatchSet

RENDERED = Path(__file__).with_name("rendered_patches.npz")
"""The file of the package."""

_ROW = 32
_QUALITY = 92


def write_rendered(path: Path, patches: PatchSet, names: Sequence[str]) -> None:
    """Write patches as `read_rendered` reads them.

    names: of their classes. Raises InputError if they can't be written.
    """
    sheets = {f"sheet{number}": sheet for number, sheet in enumerate(_sheets(patches.patches))}
    labels = {"labels": patches.labels, "targets": patches.targets.astype(np.float16), "kinds": patches.kinds}
    labels["names"] = np.array(names, dtype=np.str_)
    size = np.array(patches.patches.shape[1])
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez_compressed(file, size=size, **labels, **sheets)  # type: ignore[arg-type]


def read_rendered(path: Path, size: int, names: Sequence[str]) -> PatchSet:
    """The patches of a file that are about these classes, scaled to `size` samples along each side.

    All have the position -1 as their picture. Raises InputError if the file is missing or damaged.
    """
    file = read_arrays(path)
    try:
        made, labels = int(file["size"]), file["labels"]
        sheets = [decode(file[f"sheet{number}"].tobytes()) for number in range(_count(len(labels)))]
        targets = file["targets"].astype(np.float32)
        patches = np.concatenate([_cut(sheet, made) for sheet in sheets])[: len(labels)]
        written = [str(each) for each in file["names"]]
        kinds = np.array([names.index(each) if each in names else -1 for each in written], dtype=np.int8)[file["kinds"]]
    except (InputError, ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"can't read {path}: {one_line(error)}") from error
    if size != made:
        method = cv2.INTER_AREA if size < made else cv2.INTER_LINEAR
        patches = np.stack([cv2.resize(each, (size, size), interpolation=method) for each in patches])
    return PatchSet(patches, labels, targets, kinds, np.full(len(labels), -1, dtype=np.int32)).part(kinds >= 0)


def rendered_names(path: Path) -> tuple[str, ...]:
    """Names of the classes that the patches of a file are about. Raises InputError as `read_rendered`."""
    try:
        return tuple(map(str, read_arrays(path)["names"]))
    except KeyError as error:
        raise InputError(f"can't read {path}: it lacks {one_line(error)}") from error


def _count(patches: int) -> int:
    """Number of sheets for so many patches."""
    return -(-patches // _ROW**2)


def _sheets(patches: Image) -> Iterator[Image]:
    """The patches (n, size, size, 3), RGB, side by side in WebP files, each as bytes (k,)."""
    size = patches.shape[1]
    for number in range(_count(len(patches))):
        sheet = np.zeros((_ROW**2, size, size, 3), dtype=np.uint8)
        part = patches[number * _ROW**2 : (number + 1) * _ROW**2]
        sheet[: len(part)] = part
        image = sheet.reshape(_ROW, _ROW, size, size, 3).swapaxes(1, 2).reshape(_ROW * size, _ROW * size, 3)
        yield np.asarray(cv2.imencode(".webp", image[:, :, ::-1], [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])[1])


def _cut(sheet: Image, size: int) -> Image:
    """The patches (n, size, size, 3), RGB, of a sheet as OpenCV decodes it."""
    return np.ascontiguousarray(
        sheet[:, :, ::-1].reshape(_ROW, size, _ROW, size, 3).swapaxes(1, 2).reshape(-1, size, size, 3)
    )
