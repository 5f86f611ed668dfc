"""Cameras to draw: lens, height and attitude."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vm_embedded.config.entries import check_entries, number, share
from vm_embedded.geometry.lens import Size
from vm_embedded.geometry.lens_files import lens_from_table
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import PROJECTIONS, RadialLens, Rectilinear
from vm_workstation.ranges import range_of, some_of, uniform


@dataclass(frozen=True)
class CameraRanges:
    """Section [camera]."""

    picture_width: int = number(640, "width of pictures", "px", (64, 8192))
    picture_height: int = number(512, "height of pictures", "px", (64, 8192))
    projections: tuple[str, ...] = some_of(tuple(PROJECTIONS), "lenses to draw")
    rectilinear_view: tuple[float, float] = range_of(
        50.0, 110.0, "angle from the left to the right edge, rectilinear", "deg", (5.0, 150.0)
    )
    fisheye_view: tuple[float, float] = range_of(
        80.0, 185.0, "angle from the left to the right edge, equisolid and equidistant", "deg", (5.0, 300.0)
    )
    image_circle: float = share(0.2, "fisheyes whose image is a circle with black around it")
    circle: tuple[float, float] = range_of(
        0.5, 1.15, "diameter of that circle, in widths of the picture", "", (0.1, 2.0)
    )
    off_center: tuple[float, float] = range_of(
        -0.02, 0.02, "optical center off the picture's, in widths", "", (-0.3, 0.3)
    )
    distortion: tuple[float, float] = range_of(
        -0.04, 0.04, "k0 f^2, the first distortion coefficient times the focal length squared", "", (-0.2, 0.2)
    )
    distorted: float = share(0.5, "lenses with distortion")
    height: tuple[float, float] = range_of(0.3, 1.6, "height over the plane", "m", (0.05, 20.0))
    pitch: tuple[float, float] = range_of(
        -5.0, 50.0, "angle of the optical axis below the horizon", "deg", (-45.0, 90.0)
    )
    steep: float = share(0.2, "pictures that look down steeply")
    steep_pitch: tuple[float, float] = range_of(40.0, 90.0, "their pitch", "deg", (-45.0, 90.0))
    roll: tuple[float, float] = range_of(-10.0, 10.0, "lean to the right", "deg", (-180.0, 180.0))
    tumbled: float = share(0.04, "pictures with any roll")

    lens: Mapping[str, Any] = field(
        default_factory=dict,
        metadata={
            "help": "one lens for all pictures instead of those drawn: a table with projection, focal_length [px], fov "
            "[rad] and where they matter center, distortion and size, as in vm.toml"
        },
    )

    def __post_init__(self) -> None:
        check_entries(self)
        if self.lens:
            lens_from_table(self.lens).for_image(self.size)

    @property
    def size(self) -> Size:
        """Width and height of pictures [px]."""
        return self.picture_width, self.picture_height


def draw_lens(random: np.random.Generator, ranges: CameraRanges) -> RadialLens:
    """A lens for pictures of the configured size."""
    if ranges.lens:
        return lens_from_table(ranges.lens).for_image(ranges.size)
    projection = PROJECTIONS[str(random.choice(ranges.projections))]
    width, height = ranges.size
    straight = projection is Rectilinear
    view = math.radians(uniform(random, ranges.rectilinear_view if straight else ranges.fisheye_view))
    unit = projection(focal_length=1.0, fov=math.pi * 0.9)
    focal_length = width / 2.0 / float(unit.radius(view / 2.0))
    strength = uniform(random, ranges.distortion) if random.random() < ranges.distorted else 0.0
    center = (uniform(random, ranges.off_center) * width, uniform(random, ranges.off_center) * width)
    if straight:
        fov = math.radians(170.0)
    elif random.random() < ranges.image_circle:
        diameter = uniform(random, ranges.circle)
        focal_length *= min(diameter, 1.0)
        rim = min(diameter * width / 2.0 / focal_length, float(unit.radius(math.pi)))
        fov = 2.0 * float(unit.angle(rim))
    else:
        # As far as the corners, and the picture's center may be off the lens's.
        corner = math.hypot(width, height) / width * 1.1
        reach = float(unit.angle(min(corner * width / 2.0 / focal_length, float(unit.radius(math.radians(170.0))))))
        fov = 2.0 * reach
    distortion = (strength / focal_length**2, 0.0)
    return projection(focal_length=focal_length, fov=min(fov, 2.0 * math.pi), center=center, distortion=distortion)


def draw_orientation(random: np.random.Generator, ranges: CameraRanges) -> Orientation:
    """A height and an attitude, with any heading."""
    pitch = uniform(random, ranges.steep_pitch if random.random() < ranges.steep else ranges.pitch)
    roll = random.uniform(-180.0, 180.0) if random.random() < ranges.tumbled else uniform(random, ranges.roll)
    return Orientation.from_roll_pitch(
        uniform(random, ranges.height), math.radians(roll), math.radians(pitch), random.uniform(-math.pi, math.pi)
    )
