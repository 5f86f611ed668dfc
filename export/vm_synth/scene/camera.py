"""The camera of a scene: lens, height and orientation.

The paper has equisolid and rectilinear lenses (section "Dataset").
"""

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
    """Section [camera]: lenses and poses of cameras."""

    picture_width: int = number(640, "width of pictures", "px", (64, 8192))
    picture_height: int = number(512, "height of pictures", "px", (64, 8192))
    projections: tuple[str, ...] = some_of(tuple(PROJECTIONS), "kinds of lenses")
    rectilinear_view: tuple[float, float] = range_of(
        50.0, 110.0, "horizontal field of view of rectilinear lenses", "deg", (5.0, 150.0)
    )
    fisheye_view: tuple[float, float] = range_of(
        80.0, 185.0, "horizontal field of view of fisheyes: equisolid and equidistant lenses", "deg", (5.0, 300.0)
    )
    image_circle: float = share(0.2, "share of fisheyes with a circular image on black")
    circle: tuple[float, float] = range_of(
        0.5, 1.15, "diameter of that circle, relative to the picture's width", "", (0.1, 2.0)
    )
    off_center: tuple[float, float] = range_of(
        -0.02, 0.02, "offset of the optical center, relative to the picture's width", "", (-0.3, 0.3)
    )
    distortion: tuple[float, float] = range_of(
        -0.04, 0.04, "first distortion coefficient times the squared focal length: k0 f^2", "", (-0.2, 0.2)
    )
    distorted: float = share(0.5, "share of lenses with distortion")
    height: tuple[float, float] = range_of(0.3, 1.6, "height above the plane", "m", (0.05, 20.0))
    pitch: tuple[float, float] = range_of(
        -5.0, 50.0, "angle of the optical axis below the horizon", "deg", (-45.0, 90.0)
    )
    steep: float = share(0.2, "share of cameras that look down steeply")
    steep_pitch: tuple[float, float] = range_of(40.0, 90.0, "pitch of these cameras", "deg", (-45.0, 90.0))
    roll: tuple[float, float] = range_of(-10.0, 10.0, "roll; positive leans to the right", "deg", (-180.0, 180.0))
    tumbled: float = share(0.04, "share of cameras with a random roll from -180 to 180 deg")

    lens: Mapping[str, Any] = field(
        default_factory=dict,
        metadata={
            "help": "one lens for all pictures, instead of random lenses: a table with projection, focal_length [px], "
            "fov [rad] and, if needed, center, distortion and size, as in vm.toml"
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
    """Draw a lens for pictures of the configured size."""
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
        # The field of view reaches the corners, also with an offset of the optical center.
        corner = math.hypot(width, height) / width * 1.1
        reach = float(unit.angle(min(corner * width / 2.0 / focal_length, float(unit.radius(math.radians(170.0))))))
        fov = 2.0 * reach
    distortion = (strength / focal_length**2, 0.0)
    return projection(focal_length=focal_length, fov=min(fov, 2.0 * math.pi), center=center, distortion=distortion)


def draw_orientation(random: np.random.Generator, ranges: CameraRanges) -> Orientation:
    """Draw height, roll and pitch, with any heading."""
    pitch = uniform(random, ranges.steep_pitch if random.random() < ranges.steep else ranges.pitch)
    roll = random.uniform(-180.0, 180.0) if random.random() < ranges.tumbled else uniform(random, ranges.roll)
    return Orientation.from_roll_pitch(
        uniform(random, ranges.height), math.radians(roll), math.radians(pitch), random.uniform(-math.pi, math.pi)
    )
