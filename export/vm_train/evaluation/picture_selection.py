"""The pictures of an evaluation: all of some folders, or those in a list."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vm_embedded.errors import InputError

from ..data.picture_files import PictureFiles
from ..data.picture_lists import check_known, read_list
from ..data.pictures import find_pictures
from ..data.split import read_split


def select_pictures(folders: Sequence[Path], chosen: Path | None, part: str | None) -> list[PictureFiles]:
    """All pictures of the folders, or only those in a list.

    chosen: a text file as `read_list` reads it, or a pictures.json of vm-train. part: of pictures.json; None means
    test. Raises InputError for a number that no folder has, and if no picture is left.
    """
    is_split = chosen is not None and chosen.suffix.lower() == ".json"
    if part is not None and not is_split:
        raise InputError(f"--part {part} needs the pictures.json of a training: give it with --list")
    part = part or "test"
    found = [files for folder in folders for files in find_pictures(folder)]
    if chosen is None:
        return found
    known = {files.number for files in found}
    if is_split:
        wanted = getattr(read_split(chosen), part)
        for number in wanted:
            check_known(number, known, str(chosen))
    else:
        wanted = read_list(chosen, known)
    if not wanted:
        raise InputError(f"{chosen} names no picture" + (f" of part {part}" if is_split else ""))
    chosen_numbers = set(wanted)
    return [files for files in found if files.number in chosen_numbers]
