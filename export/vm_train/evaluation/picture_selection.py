"""Which pictures of some folders are evaluated, and what the colors of their masks mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError, unknown
from vm_embedded.network.manifest import Manifest
from vm_synth.dataset.files import COLORS

from ..data.classes import Classes, Color
from ..data.picture_files import IMAGES, PictureFiles
from ..data.pictures import find_pictures
from ..data.split import load
from ..learning.configuration import TrainConfiguration

PARTS = ("test", "validation", "training")


def pictures_of(folders: Sequence[Path], chosen: Path | None, part: str | None) -> list[PictureFiles]:
    """All pictures of the folders, or those that a list names; of a pictures.json that vm-train wrote, those of a part,
    test if it is None.

    A list has the number of a picture, or the name of its image, on each line, and # before comments. Raises InputError
    for a number that no folder has, and if no picture is left.
    """
    if part is not None and (chosen is None or chosen.suffix.lower() != ".json"):
        raise InputError(f"--part {part} is one of a pictures.json that vm-train wrote: give it with --list")
    part = part or "test"
    found = [files for folder in folders for files in find_pictures(folder)]
    if chosen is None:
        return found
    wanted = list(getattr(load(chosen), part)) if chosen.suffix.lower() == ".json" else _listed(chosen)
    known = {files.number for files in found}
    for number in wanted:
        if number not in known:
            near = get_close_matches(number, sorted(known), n=1, cutoff=0.5)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise InputError(f"{chosen}: there is no picture {number!r} in {_named(folders)}{hint}")
    kept = set(wanted)
    if not kept:
        raise InputError(f"{chosen} names no picture" + (f" of part {part}" if chosen.suffix == ".json" else ""))
    return [files for files in found if files.number in kept]


def _listed(path: Path) -> list[str]:
    try:
        rows = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:  # ValueError: not text
        raise InputError(f"can't read list {path}: {getattr(error, 'strerror', None) or error}") from error
    names = [Path(name) for row in rows if (name := row.partition("#")[0].strip())]
    return [each.stem.removeprefix("image") if each.suffix.lower() in IMAGES else str(each) for each in names]


def _named(folders: Sequence[Path]) -> str:
    return ", ".join(map(str, folders))


def usual_colors(model: Path, chosen: Path | None) -> Mapping[str, tuple[Color, ...]]:
    """Colors that masks have for classes: those of the train.toml beside a checkpoint or its pictures.json, else those
    of vm-synth. Raises InputError."""
    for folder in (each.parent for each in (chosen, model) if each is not None and each.suffix in (".json", ".pt")):
        if (folder / "train.toml").exists():
            return read_sections(TrainConfiguration, folder / "train.toml").classes.colors
    return {name: (color,) for name, color in COLORS.items()}


def classes_of(
    manifest: Manifest, usual: Mapping[str, tuple[Color, ...]], colors: Sequence[tuple[str, Color]]
) -> Classes:
    """The network's classes with the usual colors that masks have for them, and with further ones.

    Raises InputError for a color of a class that the network does not have, and for a class without any color.
    """
    names = [each.name for each in manifest.classes]
    found: dict[str, tuple[Color, ...]] = {name: usual.get(name, ()) for name in names}
    for name, color in colors:
        if name not in found:
            raise InputError(unknown("class of --color", name, names))
        if color not in found[name]:
            found[name] += (color,)
    for name, each in found.items():
        if not each:
            raise InputError(f"what color do masks have for class {name!r}? give --color {name}=R,G,B")
    return Classes(found)
