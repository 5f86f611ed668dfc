"""Environment maps: 360 degree photographs that light a scene and are its background.

A map is an equirectangular picture, row 0 at the zenith. World frame: z up, azimuth a = atan2(y, x); the map's column
is u = 1/2 - a / 2 pi of its width, so that turning to the left moves left in the picture.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.errors import InputError

SUFFIXES = (".hdr", ".exr", ".pfm")

_BINS = (256, 128)
"""Columns and rows of the upper half of a map when it is taken apart into lights."""

_SUN_RADIUS = math.radians(4.0)
_SUN_CONTRAST = 60.0  # times the median of the upper half


@dataclass(frozen=True)
class MapRanges:
    """Section [maps]: what is known of the maps of a folder, by their names without suffix."""

    held_out: tuple[str, ...] = field(
        default=(),
        metadata={"help": "maps that are never rendered unless --held-out asks for them, and then only they"},
    )
    floors: Mapping[str, float] = field(
        default_factory=dict,
        metadata={
            "help": "maps whose real floor is flat and empty from so many degrees below the horizon on",
            "unit": "deg",
        },
    )

    def __post_init__(self) -> None:
        if not isinstance(self.held_out, list | tuple) or not all(isinstance(each, str) for each in self.held_out):
            raise InputError(f"held_out must be a list of names of maps, not {self.held_out!r}")
        object.__setattr__(self, "held_out", tuple(self.held_out))
        if not isinstance(self.floors, Mapping):
            raise InputError(f"floors must be a table of maps and angles, not {self.floors!r}")
        for name, angle in self.floors.items():
            if isinstance(angle, bool) or not isinstance(angle, int | float) or not 1.0 <= angle <= 80.0:
                raise InputError(f"the floor of map {name} must be an angle from 1 to 80 deg, not {angle!r}")


def find_maps(folder: Path, ranges: MapRanges, held_out: bool) -> list[Path]:
    """The maps of a folder that are to be rendered, by name. Raises InputError if there is none."""
    if not folder.is_dir():
        raise InputError(f"there is no folder of maps {folder}")
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            if path.stem in found:
                raise InputError(f"maps {found[path.stem].name} and {path.name} of {folder} have one name; rename one")
            found[path.stem] = path
    if not found:
        raise InputError(f"no maps ({', '.join(SUFFIXES)}) in {folder}")
    chosen = [path for name, path in found.items() if (name in ranges.held_out) == held_out]
    if not chosen:
        raise InputError(f"no map of {folder} is left: {'none is' if held_out else 'all are'} held out")
    return chosen


def absent(folder: Path, ranges: MapRanges) -> list[str]:
    """Names that are held out but are no maps of the folder: maps of other folders, or slips."""
    found = {path.stem for path in folder.iterdir() if path.suffix.lower() in SUFFIXES}
    return [name for name in ranges.held_out if name not in found]


@dataclass(frozen=True)
class Lighting:
    """A map as rays are traced with it: radiance (h, w, 3) without the sun; the sun's irradiance (3,) on a surface
    that faces it, and the unit vector (3,) to it."""

    sky: Singles
    sun: Floats
    toward_sun: Floats


@dataclass(frozen=True)
class Environment:
    """A map: radiance (height, width, 3), linear RGB, and the angle [rad] below the horizon from which its floor is
    flat and empty, or None."""

    name: str
    radiance: Singles
    floor: float | None

    @classmethod
    def read(cls, path: Path, ranges: MapRanges) -> Environment:
        """Read a map. Raises InputError naming the file and its fault."""
        try:
            picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        except cv2.error:  # some builds raise where EXR is switched off
            picture = None
        if picture is None:
            hint = "; many builds of OpenCV lack EXR, save it as .hdr" if path.suffix.lower() == ".exr" else ""
            raise InputError(f"map {path.name}: can't be read, it is damaged or not what its suffix says{hint}")
        if picture.ndim != 3 or picture.shape[2] < 3 or picture.dtype != np.float32:
            raise InputError(f"map {path.name}: not a high-dynamic-range color picture")
        height, width = picture.shape[:2]
        if width != 2 * height or height < 64:
            raise InputError(f"map {path.name}: {width} x {height} px is no 360 degree picture, twice as wide as high")
        radiance = np.ascontiguousarray(picture[..., 2::-1], dtype=np.float32)
        if not np.isfinite(radiance).all() or radiance.min() < 0.0:
            raise InputError(f"map {path.name}: holds numbers that are no light (negative, infinite or NaN)")
        if not np.median(radiance) > 0.0:
            raise InputError(f"map {path.name}: more than half of it is black; the end of the file may be missing")
        floor = ranges.floors.get(path.stem)
        return cls(path.stem, radiance, None if floor is None else math.radians(floor))

    def toward(self, rays: Floats) -> Singles:
        """Radiance (h, w, 3) in the directions of unit rays (h, w, 3) of the world."""
        height, width = self.radiance.shape[:2]
        turn = np.arctan2(rays[..., 1], rays[..., 0]) / (2.0 * np.pi)
        column = (0.5 - turn) * width - 0.5
        row = np.arccos(np.clip(rays[..., 2], -1.0, 1.0)) / np.pi * height - 0.5
        map_x, map_y = column.astype(np.float32) + 2.0, np.clip(row, 0.0, height - 1.0).astype(np.float32)
        found = cv2.remap(self._wrapped, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(found, dtype=np.float32)

    @cached_property
    def _wrapped(self) -> Singles:
        return np.concatenate([self.radiance[:, -2:], self.radiance, self.radiance[:, :2]], axis=1)

    @cached_property
    def lights(self) -> tuple[Singles, Singles]:
        """Directions (n, 3) of the upper half, and the irradiance (n, 3) of each on the plane."""
        upper = self.radiance[: self.radiance.shape[0] // 2]
        small = cv2.resize(upper, _BINS, interpolation=cv2.INTER_AREA)
        polar = (np.arange(_BINS[1]) + 0.5) / _BINS[1] * np.pi / 2.0
        azimuth = 2.0 * np.pi * (0.5 - (np.arange(_BINS[0]) + 0.5) / _BINS[0])
        sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None]
        directions = np.stack(
            [sine * np.cos(azimuth), sine * np.sin(azimuth), np.broadcast_to(cosine, (_BINS[1], _BINS[0]))], axis=-1
        )
        solid = (2.0 * np.pi / _BINS[0]) * (np.pi / 2.0 / _BINS[1]) * sine
        irradiance = small * (solid * cosine)[..., None]
        return directions.reshape(-1, 3).astype(np.float32), irradiance.reshape(-1, 3).astype(np.float32)

    @cached_property
    def irradiance(self) -> Floats:
        """Light (3,) that falls on a square metre of the plane, pi times the radiance of a white one."""
        return np.asarray(self.lights[1].sum(axis=0, dtype=np.float64))

    @cached_property
    def ground(self) -> tuple[float, float, float]:
        """Albedo of the floor of the photograph, its mean radiance times pi / E, at most 0.9."""
        lower = self.radiance[self.radiance.shape[0] * 5 // 8 :].reshape(-1, 3)
        albedo = np.median(lower, axis=0) * np.pi / np.maximum(self.irradiance, 1e-6)
        red, green, blue = np.clip(albedo, 0.02, 0.9).tolist()
        return red, green, blue

    def lighting(self, size: tuple[int, int]) -> Lighting:
        """The map in the size (columns, rows) that rays are traced with, its sun taken out.

        Paths that choose their light by its strength would hardly ever choose the sky beside a sun.
        """
        sky = self.radiance
        if sky.shape[1] != size[0]:
            sky = np.asarray(cv2.resize(sky, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
        columns, rows = size
        polar = (np.arange(rows) + 0.5) / rows * np.pi
        azimuth = 2.0 * np.pi * (0.5 - (np.arange(columns) + 0.5) / columns)
        luminance = sky.mean(axis=-1)
        row, column = np.unravel_index(int(np.argmax(luminance[: rows // 2])), luminance.shape)
        sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None]
        near = sine * np.sin(polar[row]) * np.cos(azimuth - azimuth[column]) + cosine * np.cos(polar[row])
        limit = _SUN_CONTRAST * float(np.median(luminance[: rows // 2]))
        bright = (near > math.cos(_SUN_RADIUS)) & (luminance > limit)
        excess = np.where(bright[..., None], np.maximum(sky - np.float32(limit), 0.0), 0.0)
        solid = sine * (2.0 * np.pi / columns) * (np.pi / rows)
        toward = np.stack(
            [sine * np.cos(azimuth), sine * np.sin(azimuth), np.broadcast_to(cosine, luminance.shape)], axis=-1
        )
        weight = excess.mean(axis=-1) * solid
        middle = (toward * weight[..., None]).sum(axis=(0, 1))
        if np.linalg.norm(middle) == 0.0:
            middle = toward[row, column]
        return Lighting(
            sky - excess, (excess * solid[..., None]).sum(axis=(0, 1)), middle / max(np.linalg.norm(middle), 1e-12)
        )
