"""Text files that list pictures: a number or the name of an image on each line, and # before comments."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches
from pathlib import Path

from vm_embedded.errors import InputError
from vm_embedded.files import read_text

from .picture_files import IMAGES


def read_list(path: Path, numbers: Collection[str]) -> tuple[str, ...]:
    """The numbers in a list, in order and without repetition. numbers: of all pictures.

    Raises InputError naming file and line for a picture that does not exist.
    """
    known = set(numbers)
    lines = read_text(path, "list").split("\n")
    found: dict[str, None] = {}
    for line, text in enumerate(lines, start=1):
        name = text.partition("#")[0].strip()
        if name:
            file = Path(name)
            number = file.stem.removeprefix("image") if file.suffix.lower() in IMAGES else name
            check_known(number, known, f"{path}, line {line}")
            found[number] = None
    return tuple(found)


def check_known(number: str, known: Collection[str], where: str) -> None:
    """Raise InputError, with `where` in front and the nearest number, if no picture has this number."""
    if number not in known:
        near = get_close_matches(number, sorted(known), n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise InputError(f"{where}: there is no picture {number!r}{hint}")
