"""Section [object]: what to detect, if it is not the ball, and the files that it is made of."""

from __future__ import annotations

from dataclasses import dataclass

from vm_embedded.arrays import Singles
from vm_embedded.borders.text import MOST_NAME, name_fault
from vm_embedded.config.entries import check_entries, file_name, number, one_of, share, text_line
from vm_embedded.errors import InputError
from vm_workstation.ranges import range_of

from ..bodies.solids import Solid
from ..bodies.targets import TARGETS

SOLIDS = ("ball", *TARGETS, "file")
"""What the object to detect can be."""


@dataclass(frozen=True)
class ObjectRanges:
    """Section [object]: the object to detect. Raises InputError."""

    solid: str = one_of(
        SOLIDS,
        "ball",
        "the object to detect; ball: as in section [ball], on a soccer field; file: the mesh of entry file; others: a "
        "solid; all but the ball stand on a table or floor, and the detector takes them for cylinders",
    )
    name: str = text_line("object", "its class in train.toml")
    file: str = file_name("", "for solid file: an .obj or .ply file; it is scaled to radius and height")
    up: str = one_of(("y", "z"), "z", "axis of the file that points up")
    textures: str = file_name("", 'folder of pictures to wrap around it; "": random colors')
    radius: tuple[float, float] = range_of(
        0.04, 0.04, "radius of the smallest upright cylinder around it", "m", (0.002, 5)
    )
    height: tuple[float, float] = range_of(0.1, 0.1, "its height", "m", (0.002, 5.0))
    count: tuple[float, float] = range_of(0, 3, "number of objects in a picture", "", (0, 20))
    distance: tuple[float, float] = range_of(
        0.3, 2.0, "distance of the objects on the plane, uniformly distributed", "m", (0.0, 100.0)
    )
    cut: float = share(0.15, "share of objects that the picture's border may cut")
    apart: float = number(2.1, "smallest distance between the axes of two objects", "radii", (2.0, 100.0))
    wrong_size: float = share(0.25, "share of pictures with an object of the wrong size, of class environment")
    smaller: tuple[float, float] = range_of(
        0.3, 0.65, "its size if it is smaller, relative to the object", "", (0.01, 1)
    )
    larger: tuple[float, float] = range_of(1.6, 2.5, "its size if it is larger, relative to the object", "", (1, 20))

    def __post_init__(self) -> None:
        check_entries(self)
        if (self.solid == "file") != bool(self.file):
            raise InputError('file must name an .obj or .ply file if solid = "file", and be empty otherwise')
        if name_fault(self.name) or not self.name.isidentifier():
            raise InputError(
                f"name must be one word of at most {MOST_NAME} letters, digits and _, as cup, not {self.name!r}"
            )

    @property
    def is_ball(self) -> bool:
        """Whether the object is the ball of section [ball]."""
        return self.solid == "ball"


@dataclass(frozen=True)
class Assets:
    """The files of a configuration, read once.

    solid: the mesh of the object, of radius 1 and height 1, or None for a built-in solid. textures: pictures (h, w, 3)
    of linear albedo for the object. ground: the same for the table or floor.
    """

    solid: Solid | None = None
    textures: tuple[Singles, ...] = ()
    ground: tuple[Singles, ...] = ()


NO_ASSETS = Assets()
"""No files."""
