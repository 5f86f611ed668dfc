"""A picture and its lens file from an Example, the payload of a TFRecord file of the reference implementation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from vm_embedded.cameras.decoding import decode_as
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import projection_named

from ..data.picture_files import FileName

KEYS = (
    "image",
    "mask",
    "Hoc",
    "lens/projection",
    "lens/focal_length",
    "lens/fov",
    "lens/centre",
    "lens/k",
)
"""The reference's names of the features of an Example."""

SUFFIXES = {b"\xff\xd8\xff": ".jpg", b"\x89PNG\r\n\x1a\n": ".png"}
"""Suffixes of image files by their first bytes."""

_LONGEST_NORMALIZED = 10.0
"""Focal length in image widths, for a field of view of 6 degrees. In pixels, no camera has so short a focal length."""


class WrongUnitError(InputError):
    """The lens is in image widths instead of pixels, or the other way round. The other records will have it too."""


def picture_of(example: Any, number: int, renaming: Mapping[str, str], normalized: bool) -> dict[FileName, bytes]:
    """The files of the picture in an Example: image and mask as it holds them, and the lens file. The image is last.

    renaming: the Example's names of features, by our names in KEYS. normalized: the Example gives focal length, center
    and k for an image of width 1, not in pixels. Raises WrongUnitError if the focal length is in the other unit, and
    another VisualMeshError, naming the feature, for anything else that makes the Example unusable.
    """
    features = _Features(example.features.feature, {key: renaming.get(key, key) for key in KEYS})
    image, suffix, size = features.picture("image", cv2.IMREAD_COLOR)
    mask, mask_suffix, mask_size = features.picture("mask", cv2.IMREAD_UNCHANGED)
    if mask_suffix != ".png":
        raise InputError("mask is not a PNG file")
    if mask_size != size:
        raise InputError(f"mask has {_pixels(mask_size)}, but the image has {_pixels(size)}")
    return {
        FileName("mask", f"{number:07d}", ".png"): mask,
        FileName("lens", f"{number:07d}", ".yaml"): features.lens(size[0], normalized).encode(),
        FileName("image", f"{number:07d}", suffix): image,
    }


def _pixels(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]} px"


@dataclass(frozen=True)
class _Features:
    """The features of an Example. names: the Example's names by our names in KEYS.

    The methods take our names and raise a VisualMeshError that names the feature.
    """

    example: Mapping[str, Any]
    names: Mapping[str, str]

    def __post_init__(self) -> None:
        # Old files have no lens/k. If the user renames it, it must be there.
        needed = {key: name for key, name in self.names.items() if (key, name) != ("lens/k", "lens/k")}
        missing = [key for key, name in needed.items() if name not in self.example]
        if missing:
            shown = (f"{key} (as {self.names[key]!r})" if self.names[key] != key else key for key in missing)
            raise InputError(
                f"lacks {', '.join(shown)}; it has {', '.join(repr(name)[:60] for name in sorted(self.example)[:20])}; "
                "rename with --key OURS=THEIRS"
            )

    def text(self, key: str) -> bytes:
        values: tuple[bytes, ...] = tuple(self.example[self.names[key]].bytes_list.value)
        if len(values) != 1:
            raise InputError(f"{key} is not one string of bytes")
        return values[0]

    def floats(self, key: str, count: int) -> tuple[float, ...]:
        values = tuple(self.example[self.names[key]].float_list.value)
        if len(values) != count:
            raise InputError(f"{key} is not {count} floats")
        return values

    def picture(self, key: str, flags: int) -> tuple[bytes, str, tuple[int, int]]:
        """The bytes of an image file, its suffix, and its width and height [px]. flags: of cv2.imdecode."""
        data = self.text(key)
        suffix = next((suffix for start, suffix in SUFFIXES.items() if data.startswith(start)), None)
        if suffix is None:
            raise InputError(f"{key} is neither a JPEG nor a PNG file")
        try:
            decoded = decode_as(data, flags)
        except InputError as error:
            raise InputError(f"{key} {error}") from error
        if decoded.ndim != 3 or decoded.dtype != np.uint8:
            raise InputError(f"{key} is not an RGB or RGBA picture of 8 bits")
        return data, suffix, (decoded.shape[1], decoded.shape[0])

    def lens(self, width: int, normalized: bool) -> str:
        """The text of the lens file. width: of the image [px]."""
        focal_length = self.floats("lens/focal_length", 1)[0]
        if 0.0 < focal_length < _LONGEST_NORMALIZED and not normalized:
            raise WrongUnitError(
                f"lens/focal_length is {focal_length:g}, too short for pixels: it seems to be for an image of width 1; "
                "if so, import with --normalized"
            )
        if focal_length >= _LONGEST_NORMALIZED and normalized:
            raise WrongUnitError(
                f"lens/focal_length is {focal_length:g}, too long for an image of width 1: it seems to be in pixels; "
                "if so, import without --normalized"
            )
        scale = float(width) if normalized else 1.0
        x, y = self.floats("lens/centre", 2)
        k0, k1 = self.floats("lens/k", 2) if self.names["lens/k"] in self.example else (0.0, 0.0)
        lens = projection_named(self.text("lens/projection").decode("ascii", "replace"))(
            focal_length=focal_length * scale,
            fov=self.floats("lens/fov", 1)[0],
            center=(x * scale, y * scale),
            distortion=(k0 / scale**2, k1 / scale**4),
        )
        hoc = np.array(self.floats("Hoc", 16)).reshape(4, 4)
        return format_lens_file(replace(lens, size=None), Orientation.from_hoc(hoc))
