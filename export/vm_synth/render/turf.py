"""The texture of the ground: blades of grass, patches and slow changes of color, at the resolution of the pixels."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles

from ..scene.field import TURFS

_TILE = 1.024  # [m], side of the texture of 1024 x 1024 texels

_PATCHES = 6.0  # [m], side of the texture of slow color changes

_DEVIATION = 0.32  # standard deviation of the ground from its mean color


def ground_noise(points: Floats, footprint: Floats, seed: int) -> Singles:
    """Gray noise (h, w, 1) of standard deviation about 1 at points (h, w, 2) [m] of the plane.

    footprint: size (h, w) of the pixels on the ground [m]; larger pixels see less noise.
    """
    grain = turf_texture("natural", seed % 3, points, footprint).mean(axis=-1, keepdims=True)
    return np.asarray(grain / _DEVIATION, dtype=np.float32)


def turf_texture(kind: str, variant: int, points: Floats, footprint: Floats) -> Singles:
    """Deviation (h, w, 3) of the ground from its mean color at points (h, w, 2) [m] of the plane.

    kind: one of TURFS. variant: which of the textures of this kind. footprint: size (h, w) of the pixels on the ground
    [m]; it selects the level of detail, as a mipmap does.
    """
    levels = _texture_levels(kind, variant)
    starts = np.cumsum([0] + [len(level) ** 2 for level in levels])
    table = _flat_texture(kind, variant)
    level = np.clip(np.log2(np.maximum(footprint, 1e-9) / (_TILE / 1024)) + 0.5, 0, len(levels) - 1).astype(np.intp)
    n = 1024 >> level
    safe = np.where(np.isfinite(points), points, 0.0)
    place = np.floor(np.mod(safe / _TILE, 1.0) * n[..., None]).astype(np.intp) % n[..., None]
    return np.asarray(table[starts[level] + place[..., 1] * n + place[..., 0]])


def color_patches(seed: int, points: Floats) -> Singles:
    """Slow changes (h, w, 3) of the ground's color at points (h, w, 2) [m], of standard deviation about 0.1."""
    noise = _patch_texture(seed % 4)
    shift = np.random.default_rng(seed).uniform(0.0, 1.0, 2)
    place = np.mod(np.where(np.isfinite(points), points, 0.0) / _PATCHES + shift, 1.0) * len(noise)
    x, y = place[..., 0].astype(np.float32), place[..., 1].astype(np.float32)
    return np.asarray(cv2.remap(noise, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), dtype=np.float32)


@lru_cache(maxsize=9)
def _texture_levels(kind: str, variant: int) -> list[Singles]:
    """Deviation (n, n, 3) of a tile of ground from its mean color, for texels of 1, 2, 4, ... mm."""
    random = np.random.default_rng([TURFS.index(kind), variant])
    n = 1024
    if kind == "felt":
        texels = 0.25 * random.standard_normal((n, n, 1), dtype=np.float32)
        texels = texels + 0.5 * cv2.GaussianBlur(random.standard_normal((n, n, 3), dtype=np.float32), (0, 0), 2.0)
    else:
        texels = _blades(random, n, 26000, 9.0 if kind == "blades" else 16.0)
        if kind == "natural":
            patches = 0.25 * _fractal(random, n, 12.0)[..., None]
            texels = texels + patches * np.array([1.0, 0.8, 0.7], dtype=np.float32)
    texels = texels - texels.mean(axis=(0, 1))
    texels *= _DEVIATION / texels.std()
    levels = [texels.astype(np.float32)]
    while len(levels[-1]) > 1:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return levels


@lru_cache(maxsize=9)
def _flat_texture(kind: str, variant: int) -> Singles:
    """All levels of a texture as one table (k, 3) of texels, the finest first."""
    return np.concatenate([level.reshape(-1, 3) for level in _texture_levels(kind, variant)])


def _blades(random: np.random.Generator, n: int, count: int, length: float) -> Singles:
    """A tile (n, n, 3) of bright grass blades of this mean length [px] on dark ground, without seams."""
    ground = np.full((n, n, 3), -0.6, dtype=np.float32)
    starts = random.uniform(0, n, (count, 2))
    heading = random.uniform(0, 2.0 * np.pi, count)
    reach = length * random.uniform(0.5, 1.5, count)[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    shade = random.normal(0.0, 0.45, count)[:, None] + random.normal(0.0, 0.12, (count, 3))
    for start, end, color in zip(starts, starts + reach, shade.tolist(), strict=True):
        for shift in {(0, 0), *_shifts(end, n)}:
            first, last = start - np.array(shift) * n, end - np.array(shift) * n
            cv2.line(ground, (int(first[0]), int(first[1])), (int(last[0]), int(last[1])), color, 1)
    return ground


def _shifts(end: Floats, n: int) -> list[tuple[int, int]]:
    """Whole tiles by which a blade is moved so that the part beyond the edge appears on the other side."""
    x, y = (int(each) for each in np.floor(end / n))
    return [(x, y), (x, 0), (0, y)]


def _fractal(random: np.random.Generator, n: int, largest: float) -> Singles:
    """Smooth noise (n, n) of standard deviation 1 without seams, with features up to n / largest in size."""
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.fftfreq(n)[None]) * n
    spectrum = np.fft.fft2(random.standard_normal((n, n)))
    noise = np.fft.ifft2(spectrum / np.maximum(frequency, largest) ** 1.6 * (frequency > 0)).real
    return np.asarray(noise / noise.std(), dtype=np.float32)


@lru_cache(maxsize=4)
def _patch_texture(variant: int) -> Singles:
    """A tile (512, 512, 3) of slow color changes, without seams."""
    random = np.random.default_rng([7, variant])
    shade, tint = (_fractal(random, 512, 2.0) for _ in range(2))
    return np.stack([0.1 * shade + 0.05 * tint, 0.1 * shade, 0.1 * shade - 0.03 * tint], axis=-1)
