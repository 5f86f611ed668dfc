"""Everything about detection that a user may set, in one object: for Python, for vm.toml and for the command line."""

from __future__ import annotations

from dataclasses import Field, dataclass, field, fields
from typing import Any

from .errors import InputError, unknown
from .sampling import FORMATS, SAMPLINGS


def _number(default: float | None, low: float, high: float, help: str, unit: str = "") -> Any:
    return field(default=default, metadata={"help": help, "unit": unit, "range": (low, high)})


def _choice(default: str, allowed: tuple[str, ...], help: str) -> Any:
    return field(default=default, metadata={"help": help, "unit": "", "allowed": allowed})


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How a Detector works. Each field's metadata holds its help text, unit, and range or allowed values.

    Raises InputError naming a value out of range.
    """

    threads: int = _number(1, 1, 256, "threads of the network; never more than the process may use")
    spinning: bool = field(
        default=False,
        metadata={"help": "let idle threads of the network spin: faster by microseconds, eats whole cores", "unit": ""},
    )
    format: str = _choice("bgr", FORMATS, "pixel format of the frames")
    sampling: str = _choice("exact", SAMPLINGS, "how colors are read between pixels")
    height_tolerance: float = _number(
        0.5,
        0.0,
        2.0,
        "largest change in the number of rings across an object before another height gets its own mesh; 0 gives "
        "every frame a mesh at its own height and heading, as the reference does, and prepares nothing for the next",
        "rings",
    )
    pitch_step: float = _number(0.05, 1e-3, 1.0, "pitches that share prepared work", "rad")
    roll_step: float = _number(0.05, 1e-3, 1.0, "rolls that share prepared work", "rad")
    cache_mib: float = _number(64.0, 0.0, 65536.0, "memory for prepared meshes", "MiB")
    object_radius: float | None = _number(
        None,
        1e-3,
        10.0,
        "radius of the real object where it differs from the model's; the mesh follows if the network knows objects of "
        "any radius",
        "m",
    )
    max_distance: float | None = _number(
        None,
        0.1,
        1e4,
        "how far out the mesh reaches, if not as far as the model says; an object is seen whole where the mesh goes on "
        "behind it",
        "m",
    )
    threshold: float = _number(0.5, 0.0, 1.0, "probability from which a point counts for a class")
    min_inside: float = _number(0.85, 0.0, 1.0, "mean probability that an object needs inside its outline")
    max_around: float = _number(0.25, 0.0, 1.0, "mean probability that an object may have in the band around it")
    max_widths: float = _number(
        2.0, 1.0, 100.0, "width of a cluster from which it can't be one object", "object widths"
    )
    min_visible: float = _number(0.25, 0.0, 1.0, "share of an object's points that must be on screen")

    def __post_init__(self) -> None:
        for each in fields(self):
            check_setting(each, getattr(self, each.name))


def check_setting(each: Field[Any], value: object) -> None:
    """Raise InputError if a value is not of the field's type or range."""
    if value is None and each.default is None:
        return
    allowed, limits = each.metadata.get("allowed"), each.metadata.get("range")
    if allowed is not None and value not in allowed:
        raise InputError(unknown(each.name, value, allowed))
    if allowed is None and limits is None and not isinstance(value, bool):
        raise InputError(f"{each.name} must be true or false, not {value!r}")
    if limits is not None:
        whole = isinstance(each.default, int)
        kind, unit = ("a whole number" if whole else "a number"), each.metadata["unit"]
        fits = isinstance(value, int) if whole else isinstance(value, int | float)
        if not fits or isinstance(value, bool) or not limits[0] <= value <= limits[1]:
            raise InputError(
                f"{each.name} must be {kind} from {limits[0]:g} to {limits[1]:g}{' ' + unit if unit else ''}, "
                f"not {value!r}"
            )
