"""Environment maps: 360 degree photographs that light a scene and are its background.

A map is an equirectangular picture, row 0 at the zenith. World frame: z up, azimuth a = atan2(y, x); the map's column
is u = 1/2 - a / 2 pi of its width, so a turn to the left moves left in the picture.

The paper lights its scenes with 360 degree HDR images, too (section "Dataset").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Singles
from vm_embedded.errors import InputError
from vm_embedded.files import read_regular

from .maps import MapRanges

_BINS = (256, 128)
"""Columns and rows into which the upper half of a map is divided; each is a light."""

_SUN_RADIUS = math.radians(4.0)

_SUN_CONTRAST = 60.0  # the sun is brighter than this many times the median of the upper half


@dataclass(frozen=True)
class Lighting:
    """A map prepared for ray tracing.

    sky: radiance (h, w, 3) without the sun. sun: its irradiance (3,) on a surface that faces it. toward_sun: unit
    vector (3,) to it.
    """

    sky: Singles
    sun: Floats
    toward_sun: Floats


@dataclass(frozen=True)
class Environment:
    """A map: linear RGB radiance (height, width, 3).

    floor: angle below the horizon [rad] where its flat and empty floor begins, or None without such a floor.
    """

    name: str
    radiance: Singles
    floor: float | None

    @classmethod
    def read(cls, path: Path, ranges: MapRanges) -> Environment:
        """Read a map. Raises InputError that names the file and what is wrong with it."""
        try:
            content = read_regular(path)
        except OSError as error:
            raise InputError(f"map {path.name}: can't be read: {error.strerror or error}") from error
        try:
            picture = cv2.imdecode(np.frombuffer(content or b"\0", dtype=np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:  # some builds of OpenCV raise an error if EXR is disabled
            picture = None
        if picture is None:
            hint = "; many builds of OpenCV can't read EXR: save it as .hdr" if path.suffix.lower() == ".exr" else ""
            raise InputError(f"map {path.name}: can't be read; it is damaged or has the wrong suffix{hint}")
        if picture.ndim != 3 or picture.shape[2] < 3 or picture.dtype != np.float32:
            raise InputError(f"map {path.name}: not a high-dynamic-range color picture (floating point RGB)")
        height, width = picture.shape[:2]
        if width != 2 * height or height < 64:
            raise InputError(
                f"map {path.name}: its size is {width} x {height} px; it must be "
                "twice as wide as high and at least 128 x 64 px"
            )
        radiance = np.ascontiguousarray(picture[..., 2::-1], dtype=np.float32)
        if not np.isfinite(radiance).all() or radiance.min() < 0.0:
            raise InputError(f"map {path.name}: contains negative, infinite or NaN values")
        if not np.median(radiance) > 0.0:
            raise InputError(f"map {path.name}: more than half of it is black; the file may be incomplete")
        floor = ranges.floors.get(path.stem)
        return cls(path.stem, radiance, None if floor is None else math.radians(floor))

    def radiance_along(self, rays: Floats) -> Singles:
        """Radiance (h, w, 3) along unit rays (h, w, 3) in the world frame."""
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
        """The upper half as n lights: their directions (n, 3) and their irradiance (n, 3) on the plane."""
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
        """Irradiance (3,) on the plane: pi times the radiance of a white plane."""
        return np.asarray(self.lights[1].sum(axis=0, dtype=np.float64))

    @cached_property
    def floor_albedo(self) -> tuple[float, float, float]:
        """Albedo of the floor in the photograph: its median radiance times pi / irradiance, from 0.02 to 0.9."""
        lower = self.radiance[self.radiance.shape[0] * 5 // 8 :].reshape(-1, 3)
        albedo = np.median(lower, axis=0) * np.pi / np.maximum(self.irradiance, 1e-6)
        red, green, blue = np.clip(albedo, 0.02, 0.9).tolist()
        return red, green, blue

    def lighting(self, size: tuple[int, int]) -> Lighting:
        """The map resized to (columns, rows), with the sun as a separate light.

        A path tracer picks lights by their strength: with the sun in the map it would hardly ever pick the sky.
        """
        sky = self.radiance
        if sky.shape[1] != size[0]:
            sky = np.asarray(cv2.resize(sky, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
        columns, rows = size
        polar = (np.arange(rows) + 0.5) / rows * np.pi
        azimuth = 2.0 * np.pi * (0.5 - (np.arange(columns) + 0.5) / columns)
        luminance = sky.mean(axis=-1)
        row, column = np.unravel_index(int(np.argmax(luminance[: rows // 2])), luminance.shape)
        limit = _SUN_CONTRAST * float(np.median(luminance[: rows // 2]))
        # Few pixels are that bright: only they need the geometry.
        lines, places = np.nonzero(luminance > limit)
        near = np.sin(polar[lines]) * np.sin(polar[row]) * np.cos(azimuth[places] - azimuth[column])
        bright = near + np.cos(polar[lines]) * np.cos(polar[row]) > math.cos(_SUN_RADIUS)
        lines, places = lines[bright], places[bright]
        excess = np.maximum(sky[lines, places] - np.float32(limit), 0.0)
        solid = np.sin(polar[lines]) * (2.0 * np.pi / columns) * (np.pi / rows)
        weight = excess.mean(axis=-1) * solid
        middle = (_directions(polar[lines], azimuth[places]) * weight[:, None]).sum(axis=0)
        if np.linalg.norm(middle) == 0.0:
            middle = _directions(polar[row], azimuth[column])
        sky = sky.copy()
        sky[lines, places] -= excess
        return Lighting(sky, (excess * solid[:, None]).sum(axis=0), middle / max(np.linalg.norm(middle), 1e-12))


def _directions(polar: Floats, azimuth: Floats) -> Floats:
    """Unit vectors (..., 3) with these polar and azimuth angles (...) [rad]."""
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
