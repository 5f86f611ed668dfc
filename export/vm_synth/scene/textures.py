"""Textures of tables, floors and objects: pictures of the user, or drawn at random. All are linear albedo."""

from __future__ import annotations

import colorsys
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Singles
from vm_embedded.errors import InputError
from vm_embedded.files import read_bytes

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp")

_SIDE = 512  # texels along each side

KINDS = ("plain", "wood", "checks", "stripes", "speckles", "cloth", "blotches")
"""Textures that are drawn."""


def read_textures(folder: Path) -> tuple[Singles, ...]:
    """The pictures of a folder as textures (512, 512, 3), sorted by name.

    Raises InputError if there are none or one can't be read.
    """
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder} of textures ({', '.join(SUFFIXES)})")
    paths = texture_files(folder)
    if not paths:
        raise InputError(f"there are no pictures ({', '.join(SUFFIXES)}) in the folder of textures {folder}")
    return tuple(_read(path) for path in paths)


def texture_files(folder: Path) -> list[Path]:
    """The pictures of a folder, sorted by name."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)


def _read(path: Path) -> Singles:
    content = read_bytes(path, "texture")
    picture = cv2.imdecode(np.frombuffer(content or b"\0", dtype=np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise InputError(f"texture {path} can't be read: it is damaged or not a picture")
    how = cv2.INTER_AREA if min(picture.shape[:2]) > _SIDE else cv2.INTER_LINEAR
    small = cv2.resize(picture, (_SIDE, _SIDE), interpolation=how)
    return _to_albedo(small[..., ::-1].astype(np.float32) / 255.0)


def _to_albedo(picture: Singles) -> Singles:
    """Linear albedo of a picture in sRGB, 0 to 1."""
    linear = np.where(picture <= 0.04045, picture / 12.92, ((picture + 0.055) / 1.055) ** 2.4)
    return np.ascontiguousarray(np.clip(linear, 0.01, 0.95), dtype=np.float32)


def draw_texture(random: np.random.Generator) -> Singles:
    """Draw a texture (512, 512, 3) of any kind."""
    kind = KINDS[random.integers(len(KINDS))]
    first, second = _color(random), _color(random)
    share = np.clip(_pattern(random, kind), 0.0, 1.0)[..., None]
    picture = first + random.uniform(0.15, 1.0) * share * (second - first)
    picture = picture * (1.0 + random.uniform(0.0, 0.25) * _noise(random, random.uniform(0.5, 4.0))[..., None])
    return np.ascontiguousarray(np.clip(picture, 0.01, 0.95), dtype=np.float32)


def _pattern(random: np.random.Generator, kind: str) -> Singles:
    """Share (512, 512) of the second color."""
    x, y = np.meshgrid(*2 * [np.arange(_SIDE, dtype=np.float32) / _SIDE])
    if kind == "wood":
        boards = int(random.integers(2, 9))
        tone = random.uniform(0.0, 1.0, boards).astype(np.float32)[(y * boards).astype(np.intp)]
        grain = np.sin(2.0 * np.pi * (random.integers(8, 40) * y + 0.6 * _noise(random, 40.0)))
        seam = ((y * boards) % 1.0 < 0.02).astype(np.float32)
        return np.asarray(0.5 * tone + 0.25 * grain + seam, dtype=np.float32)
    if kind == "checks":
        count = int(random.integers(1, 9))
        return np.asarray((np.sin(2 * np.pi * count * x) * np.sin(2 * np.pi * count * y) > 0.0), dtype=np.float32)
    if kind == "stripes":
        return np.asarray(np.sin(2 * np.pi * random.integers(2, 24) * x) > random.uniform(-0.8, 0.8), dtype=np.float32)
    if kind == "speckles":
        return np.asarray(_noise(random, random.uniform(1.0, 5.0)) > random.uniform(0.5, 2.0), dtype=np.float32)
    if kind == "cloth":
        threads = 2 * np.pi * int(random.integers(30, 90))
        return np.asarray(0.5 + 0.25 * (np.sin(threads * x) + np.sin(threads * y)), dtype=np.float32)
    if kind == "blotches":
        return np.asarray(0.5 + 0.4 * _noise(random, random.uniform(15.0, 60.0)), dtype=np.float32)
    return np.zeros((_SIDE, _SIDE), dtype=np.float32)


def _noise(random: np.random.Generator, size: float) -> Singles:
    """Smooth noise (512, 512) of standard deviation 1 without seams, with features of this size [texels]."""
    white = random.standard_normal((_SIDE, _SIDE), dtype=np.float32)
    blurred = np.asarray(np.fft.ifft2(np.fft.fft2(white) * _low_pass(size)).real, dtype=np.float32)
    return blurred / np.float32(max(float(blurred.std()), 1e-6))


def _low_pass(size: float) -> Singles:
    frequency = np.fft.fftfreq(_SIDE)
    falloff = np.exp(-2.0 * (np.pi * size * frequency) ** 2)
    return np.asarray(np.outer(falloff, falloff), dtype=np.float32)


def _color(random: np.random.Generator) -> Singles:
    """Albedo (3,): brown, gray or white as often as any other color."""
    kind, value = random.integers(4), float(np.exp(random.uniform(np.log(0.04), np.log(0.85))))
    hue, saturation = (random.uniform(0.05, 0.1), random.uniform(0.3, 0.8)) if kind == 0 else (random.random(), 0.0)
    if kind == 1:
        saturation = random.uniform(0.2, 0.95)
    elif kind > 1:
        saturation = random.uniform(0.0, 0.12)
    return np.array(colorsys.hsv_to_rgb(hue, saturation, value), dtype=np.float32)
