"""All settings of detection in one object, for Python, vm.toml and the command line."""

from __future__ import annotations

from dataclasses import dataclass

from ..config.entries import check_entries, number, one_of, share, switch
from ..config.units import angle
from .pixel_formats import FORMATS


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a Detector. Each field's metadata holds its help text, unit, and limits or allowed values.

    Raises EntryError, an InputError, for a value outside of its limits.
    """

    threads: int = number(1, "threads of the network, at most the cores that the process may use", "", (1, 256))
    spinning: bool = switch(False, "let idle threads of ONNX Runtime spin: saves microseconds, occupies whole cores")
    format: str = one_of(FORMATS, "bgr", "pixel format of the frames")
    height_tolerance: float = number(
        0.5,
        "a new camera height gets its own mesh if the number of rings across an object changes by more than this; "
        "0, for comparisons with the reference: each frame gets its own mesh, which does not turn with the camera's "
        "yaw; slower",
        "rings",
        (0.0, 2.0),
    )
    pitch_step: float = angle(0.05, "width of the pitch interval that shares one cache entry", (1e-3, 1.0))
    roll_step: float = angle(0.05, "width of the roll interval that shares one cache entry", (1e-3, 1.0))
    cache_mib: float = number(64.0, "memory for meshes and prepared points", "MiB", (0.0, 65536.0))
    object_radius: float | None = number(
        None,
        "radius of your object, if it differs from the model's (0.095 m for those of the package); a network that was "
        "trained for any radius also gets a mesh for it",
        "m",
        (1e-3, 10.0),
    )
    max_distance: float | None = number(
        None,
        "distance up to which the mesh has points, if it differs from the model's; choose a little more than the "
        "distance of your farthest object",
        "m",
        (0.1, 1e4),
    )
    threshold: float = share(0.5, "a point belongs to a class if its probability is above this")
    min_confidence: float = share(0.3, "peaks: lowest probability of an object; below it, it is rejected")
    min_inside: float = share(
        0.85, "without peaks: lowest mean probability inside the outline; below it, the object is rejected"
    )
    max_around: float = share(
        0.25, "without peaks: highest mean probability just outside the outline; above it, the object is rejected"
    )
    max_widths: float = number(2.0, "without peaks: reject clusters wider than this", "object widths", (1.0, 100.0))
    min_visible: float = share(0.25, "without peaks: reject objects with a smaller share of their points on screen")
    field_features: bool = switch(
        True, "find goal posts, robots, lines and the border, if the network has the classes goal, robot, line or field"
    )

    def __post_init__(self) -> None:
        check_entries(self)
