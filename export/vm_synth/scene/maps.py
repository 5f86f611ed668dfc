"""Which environment maps of a folder are rendered.

The paper's maps are from RoboCup, a laboratory and HDRI Haven (section "Dataset").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from vm_embedded.arrays import number_or_nan
from vm_embedded.errors import InputError

SUFFIXES = (".hdr", ".exr", ".pfm")


@dataclass(frozen=True)
class MapRanges:
    """Section [maps]: properties of the maps of a folder, by file name without suffix."""

    held_out: tuple[str, ...] = field(
        default=(),
        metadata={"help": "maps for testing; with --held-out, vm-synth uses only these; without it, all others"},
    )
    floors: Mapping[str, float] = field(
        default_factory=dict,
        metadata={
            "help": "maps with a flat, empty floor, each with the angle below the horizon where the floor begins",
            "unit": "deg",
        },
    )

    def __post_init__(self) -> None:
        if not isinstance(self.held_out, list | tuple) or not all(isinstance(each, str) for each in self.held_out):
            raise InputError(f"held_out must be a list of map names, not {self.held_out!r}")
        object.__setattr__(self, "held_out", tuple(self.held_out))
        if not isinstance(self.floors, Mapping):
            raise InputError(f"floors must be a table of map names and angles, not {self.floors!r}")
        for name, angle in self.floors.items():
            if not 1.0 <= number_or_nan(angle) <= 80.0:
                raise InputError(f"the floor of map {name} must begin 1 to 80 deg below the horizon, not {angle!r}")


def find_maps(folder: Path, ranges: MapRanges, held_out: bool) -> list[Path]:
    """The maps of a folder to render, sorted by name: those held out for testing, or all others.

    Raises InputError if there are none, or if two maps differ only in their suffix.
    """
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}; --hdri needs a folder of maps ({', '.join(SUFFIXES)})")
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES:
            if path.stem in found:
                raise InputError(
                    f"maps {found[path.stem].name} and {path.name} in {folder} have the same name; rename one"
                )
            found[path.stem] = path
    if not found:
        raise InputError(f"there are no maps ({', '.join(SUFFIXES)}) in {folder}")
    chosen = [path for name, path in found.items() if (name in ranges.held_out) == held_out]
    if not chosen:
        raise InputError(f"{'none' if held_out else 'all'} of the maps in {folder} are held out: nothing to render")
    return chosen


def missing_held_out(folder: Path, ranges: MapRanges) -> list[str]:
    """Names in held_out without a map in this folder: they are maps of other folders, or misspelled."""
    found = {path.stem for path in folder.iterdir() if path.suffix.lower() in SUFFIXES}
    return [name for name in ranges.held_out if name not in found]
