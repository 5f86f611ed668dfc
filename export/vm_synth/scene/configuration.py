"""scene.toml: the ranges from which scenes are drawn, one section for each part of a scene."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from vm_embedded.config.entries import check_entries, file_name, one_of, share
from vm_workstation.ranges import range_of

from ..balls.draw_design import DesignRanges
from ..bodies.catalog import BodyRanges
from .camera import CameraRanges
from .field import FieldRanges
from .maps import MapRanges
from .own_object import ObjectRanges
from .sensor import SensorRanges
from .surface import TableRanges

CLASSES = ("ball", "goal", "line", "field", "environment", "robot")
"""The classes of pixels; masks during rendering hold positions in this tuple."""


HEADER = """Configuration of vm-synth. `vm-synth config` prints this file.
Keep only the entries that you change: missing entries have their defaults.
Each comment gives the meaning of the next entry, its unit in brackets, and its limits.
An entry [low, high] is a range: each picture gets a random value between the two."""
"""First comment of a scene.toml that is printed."""


@dataclass(frozen=True)
class GroundRanges:
    """Section [ground]: the ground below the ball or the objects."""

    kind: str = one_of(
        ("table", "floor"), "table", "ground below objects that are not the ball; the ball lies on a field"
    )
    textures: str = file_name("", 'folder of pictures of tables or floors to put there; "": random textures')

    photographed: float = share(
        0.5, "share of pictures that show the flat floor of their map, if it has one; the others show a field"
    )
    detail: tuple[float, float] = range_of(
        0.02,
        0.12,
        "noise added to a photographed floor, because maps are too coarse",
        "",
        (0, 1),
    )
    light: tuple[float, float] = range_of(0.0, 0.2, "unevenness of the light on a field", "", (0.0, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class TargetRanges:
    """Section [ball]: size and place of the ball, and balls of the wrong size or height."""

    radius: tuple[float, float] = range_of(0.05, 0.12, "radius of the ball", "m", (0.005, 1.0))
    distance: tuple[float, float] = range_of(
        0.0,
        10.0,
        "distance of the ball on the plane; its size in the picture is uniformly distributed",
        "m",
        (0.0, 100.0),
    )
    # The paper has fewer far balls, so its plots are noisy there (section "Precision").
    even: float = share(
        0.0, "share of pictures whose ball distance is uniformly distributed instead, for more far balls"
    )
    missing: float = share(0.1, "share of pictures without a ball")
    cut: float = share(0.15, "share of pictures whose border may cut the ball")
    hidden: float = share(0.2, "share of pictures with an object that may hide the ball")
    on_line: float = share(0.0, "share of fields with a line below the ball or beside it")
    touched: float = share(0.0, "share of pictures with a robot, person or shoe that touches the ball")
    off_plane: float = share(0.08, "share of pictures with another ball on a pedestal or in the air")
    off_plane_height: tuple[float, float] = range_of(0.1, 1.2, "height of that ball above the plane", "m", (0.01, 5.0))
    off_plane_label: str = one_of(CLASSES, "environment", "class of that ball")
    wrong_size: float = share(0.25, "share of pictures with another ball of the wrong size, of class environment")
    smaller: tuple[float, float] = range_of(
        0.25, 0.6, "radius of such a ball if it is smaller, relative to the ball", "", (0.01, 1.0)
    )
    larger: tuple[float, float] = range_of(
        1.7, 3.0, "radius of such a ball if it is larger, relative to the ball", "", (1.0, 20.0)
    )

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class ThingRanges:
    """Section [things]: numbers of objects around the ball."""

    robots: tuple[float, float] = range_of(0, 3, "number of robots", "", (0, 20))
    clutter: tuple[float, float] = range_of(0, 4, "number of small objects", "", (0, 50))
    round_things: tuple[float, float] = range_of(0, 2, "number of round objects that are not the ball", "", (0, 50))
    furniture: tuple[float, float] = range_of(0, 1, "number of tables, chairs, poles and boards", "", (0, 20))
    people: tuple[float, float] = range_of(0, 1, "number of people, or only their legs", "", (0, 20))
    carrier: float = share(0.35, "share of pictures with the carrier of the camera: a tripod, hands, a robot's body")
    distance: tuple[float, float] = range_of(
        0.25, 9.0, "distance of objects from the camera on the plane", "m", (0.13, 100.0)
    )

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class SceneConfiguration:
    """All sections of scene.toml."""

    maps: MapRanges = dataclasses.field(default_factory=MapRanges)
    camera: CameraRanges = dataclasses.field(default_factory=CameraRanges)
    ground: GroundRanges = dataclasses.field(default_factory=GroundRanges)
    field: FieldRanges = dataclasses.field(default_factory=FieldRanges)
    object: ObjectRanges = dataclasses.field(default_factory=ObjectRanges)
    table: TableRanges = dataclasses.field(default_factory=TableRanges)
    ball: TargetRanges = dataclasses.field(default_factory=TargetRanges)
    ball_design: DesignRanges = dataclasses.field(default_factory=DesignRanges)
    things: ThingRanges = dataclasses.field(default_factory=ThingRanges)
    bodies: BodyRanges = dataclasses.field(default_factory=BodyRanges)
    sensor: SensorRanges = dataclasses.field(default_factory=SensorRanges)
