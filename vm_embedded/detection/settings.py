"""Everything about detection that a user may set, in one object: for Python, for vm.toml and for the command line."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.entries import check_entries, number, one_of, share, switch
from .sampling import FORMATS, SAMPLINGS


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a Detector works. Each field's metadata holds its help text, unit, and limits or allowed values.

    Raises EntryError naming a value out of its limits.
    """

    threads: int = number(1, "threads of the network; never more than the process may use", "", (1, 256))
    spinning: bool = switch(False, "let idle threads of the network spin: faster by microseconds, eats whole cores")
    format: str = one_of(FORMATS, "bgr", "pixel format of the frames")
    sampling: str = one_of(SAMPLINGS, "exact", "how colors are read between pixels")
    height_tolerance: float = number(
        0.5,
        "largest change in the number of rings across an object before another height gets its own mesh; 0 gives "
        "every frame a mesh at its own height and heading, as the reference does, and prepares nothing for the next",
        "rings",
        (0.0, 2.0),
    )
    pitch_step: float = number(0.05, "pitches that share prepared work", "rad", (1e-3, 1.0))
    roll_step: float = number(0.05, "rolls that share prepared work", "rad", (1e-3, 1.0))
    cache_mib: float = number(64.0, "memory for prepared meshes", "MiB", (0.0, 65536.0))
    object_radius: float | None = number(
        None,
        "radius of the real object where it differs from the model's; the mesh follows if the network knows objects of "
        "any radius",
        "m",
        (1e-3, 10.0),
    )
    max_distance: float | None = number(
        None,
        "how far out the mesh reaches, if not as far as the model says; an object is seen whole where the mesh goes on "
        "behind it",
        "m",
        (0.1, 1e4),
    )
    threshold: float = share(0.5, "probability from which a point counts for a class")
    min_inside: float = share(0.85, "mean probability that an object needs inside its outline")
    max_around: float = share(0.25, "mean probability that an object may have in the band around it")
    max_widths: float = number(
        2.0, "width of a cluster from which it can't be one object", "object widths", (1.0, 100.0)
    )
    min_visible: float = share(0.25, "share of an object's points that must be on screen")

    def __post_init__(self) -> None:
        check_entries(self)
