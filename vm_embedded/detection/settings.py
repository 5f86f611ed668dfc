"""All settings of detection in one object, for Python, vm.toml and the command line."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.entries import check_entries, number, one_of, share, switch
from .pixel_formats import FORMATS
from .sampling import SAMPLINGS


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a Detector. Each field's metadata holds its help text, unit, and limits or allowed values.

    Raises EntryError for a value outside of its limits.
    """

    threads: int = number(1, "threads of the network, at most the cores that the process may use", "", (1, 256))
    spinning: bool = switch(False, "let idle threads spin: saves microseconds, occupies whole cores")
    format: str = one_of(FORMATS, "bgr", "pixel format of the frames")
    sampling: str = one_of(SAMPLINGS, "exact", "how to read colors between pixels")
    height_tolerance: float = number(
        0.5,
        "largest change of the number of rings across an object before another height gets its own mesh; 0: every "
        "frame gets a mesh at its own height and heading, as in the reference, which is slower",
        "rings",
        (0.0, 2.0),
    )
    pitch_step: float = number(0.05, "range of pitch that shares prepared points", "rad", (1e-3, 1.0))
    roll_step: float = number(0.05, "range of roll that shares prepared points", "rad", (1e-3, 1.0))
    cache_mib: float = number(64.0, "memory for meshes and prepared points", "MiB", (0.0, 65536.0))
    object_radius: float | None = number(
        None,
        "radius of the real object, if it differs from the model's; a network for any radius also gets a new mesh",
        "m",
        (1e-3, 10.0),
    )
    max_distance: float | None = number(
        None,
        "reach of the mesh, if it differs from the model's; choose it a little farther than the farthest object",
        "m",
        (0.1, 1e4),
    )
    threshold: float = share(0.5, "probability above which a point counts for a class")
    min_inside: float = share(0.85, "lowest mean probability inside the outline of an accepted object")
    max_around: float = share(0.25, "highest mean probability in the band around an accepted object")
    max_widths: float = number(2.0, "largest width of a cluster that may be one object", "object widths", (1.0, 100.0))
    min_visible: float = share(0.25, "lowest share of an object's points that must be on screen")

    def __post_init__(self) -> None:
        check_entries(self)
