"""scene.toml: all ranges that pictures are drawn from, a section for each part of the scene."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from vm_embedded.config.entries import check_entries, one_of, share
from vm_workstation.ranges import range_of

from ..balls.draw_design import DesignRanges
from ..bodies.catalog import BodyRanges
from .camera import CameraRanges
from .field import FieldRanges
from .maps import MapRanges
from .sensor import SensorRanges

CLASSES = ("ball", "goal", "line", "field", "environment", "robot")
"""What pixels count as, by position."""


@dataclass(frozen=True)
class GroundRanges:
    """Section [ground]."""

    photographed: float = share(0.5, "pictures on the real floor of the map, where it has a flat one; else on a field")
    detail: tuple[float, float] = range_of(
        0.02,
        0.12,
        "strength of the grain that a photographed floor gets, as maps are coarser than pictures",
        "",
        (0, 1),
    )
    light: tuple[float, float] = range_of(0.0, 0.2, "unevenness of the light on a field", "", (0.0, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class TargetRanges:
    """Section [ball]: where the ball is."""

    radius: tuple[float, float] = range_of(0.05, 0.12, "radius of the ball", "m", (0.005, 1.0))
    distance: tuple[float, float] = range_of(
        0.0, 10.0, "distance on the plane, drawn so that the size in the picture is uniform", "m", (0.0, 100.0)
    )
    even: float = share(0.0, "pictures for which the distance itself is uniform: more far balls")
    missing: float = share(0.1, "pictures without a ball")
    cut: float = share(0.15, "pictures whose border may cut the ball")
    hidden: float = share(0.2, "pictures with something between ball and camera, beside it or before it")
    off_plane: float = share(0.08, "pictures with a ball on a pedestal or in the air")
    off_plane_height: tuple[float, float] = range_of(0.1, 1.2, "its height over the plane", "m", (0.01, 5.0))
    off_plane_label: str = one_of(CLASSES, "environment", "what such a ball counts as")
    wrong_size: float = share(0.25, "pictures with a ball of another size, which counts as environment")
    smaller: tuple[float, float] = range_of(0.25, 0.6, "its radius, if smaller, in radii of the ball", "", (0.01, 1.0))
    larger: tuple[float, float] = range_of(1.7, 3.0, "its radius, if larger, in radii of the ball", "", (1.0, 20.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class ThingRanges:
    """Section [things]: how many things stand around."""

    robots: tuple[float, float] = range_of(0, 3, "robots", "", (0, 20))
    clutter: tuple[float, float] = range_of(0, 4, "things of 5 to 50 cm", "", (0, 50))
    round_things: tuple[float, float] = range_of(0, 2, "round things that are no ball", "", (0, 50))
    furniture: tuple[float, float] = range_of(0, 1, "tables, chairs, poles and boards", "", (0, 20))
    people: tuple[float, float] = range_of(0, 1, "people and legs", "", (0, 20))
    carrier: float = share(0.35, "pictures that show who or what carries the camera, or holds something before it")
    distance: tuple[float, float] = range_of(0.25, 9.0, "distance from the camera on the plane", "m", (0.13, 100.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class SceneConfiguration:
    """All sections."""

    maps: MapRanges = dataclasses.field(default_factory=MapRanges)
    camera: CameraRanges = dataclasses.field(default_factory=CameraRanges)
    ground: GroundRanges = dataclasses.field(default_factory=GroundRanges)
    field: FieldRanges = dataclasses.field(default_factory=FieldRanges)
    ball: TargetRanges = dataclasses.field(default_factory=TargetRanges)
    ball_design: DesignRanges = dataclasses.field(default_factory=DesignRanges)
    things: ThingRanges = dataclasses.field(default_factory=ThingRanges)
    bodies: BodyRanges = dataclasses.field(default_factory=BodyRanges)
    sensor: SensorRanges = dataclasses.field(default_factory=SensorRanges)
