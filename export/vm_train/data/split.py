"""Which pictures a network learns from, which choose the best network, and which are kept for its evaluation."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import atomic_write

from .picture_files import IMAGES

_DRAWS = 1 << 64
_NAMED = 5  # pictures in a message


@dataclass(frozen=True)
class Split:
    """Numbers of the pictures of each part, in order. Raises InputError if two parts share a picture."""

    training: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        parts = list(asdict(self).items())
        for position, (name, numbers) in enumerate(parts):
            for other, others in parts[position + 1 :]:
                shared = sorted(set(numbers).intersection(others))
                if shared:
                    more = f" and {len(shared) - _NAMED} more" if len(shared) > _NAMED else ""
                    raise InputError(f"{name} and {other} share pictures {', '.join(shared[:_NAMED])}{more}")


def split_by_seed(numbers: Sequence[str], validation: float, test: float, seed: int) -> Split:
    """Split pictures by chance; `validation` and `test` are about the shares of these parts, from 0 to 1.

    A picture's part depends on nothing but the seed, the shares and its number, so more pictures move none of the
    others. Raises InputError for shares that leave nothing to train on, or if training or validation gets no picture.
    """
    if not (0.0 <= validation <= 1.0 and 0.0 <= test <= 1.0 and validation + test < 1.0):
        raise InputError(
            f"shares of validation and test must be 0 or more and below 1 in all, not {validation}, {test}"
        )
    parts: dict[str, list[str]] = {"training": [], "validation": [], "test": []}
    for number in numbers:
        drawn = _draw(seed, number)
        part = "validation" if drawn < validation else "test" if drawn < validation + test else "training"
        parts[part].append(number)
    split = Split(**{name: tuple(each) for name, each in parts.items()})
    return _checked(split, len(numbers), "change its share or the seed, or name its pictures in a list")


def _draw(seed: int, number: str) -> float:
    """A number from 0 to 1 that looks drawn by chance."""
    digest = hashlib.sha256(f"{seed}:{number}".encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:8], "big") / _DRAWS


def split_by_lists(numbers: Sequence[str], training: Path | None, validation: Path | None, test: Path | None) -> Split:
    """Split pictures by text files that have a number or the name of an image on each line, and # before comments.

    Without a list for it, training gets all pictures that no list names, and another part none. Raises InputError
    naming file and line for a picture that is not there, for one that two parts have, and if training or validation
    gets no picture.
    """
    known = set(numbers)
    chosen = {
        name: () if path is None else _listed(path, numbers, known)
        for name, path in (("training", training), ("validation", validation), ("test", test))
    }
    if training is None:
        named = {*chosen["validation"], *chosen["test"]}
        chosen["training"] = tuple(each for each in numbers if each not in named)
    return _checked(Split(**chosen), len(numbers), "name its pictures in a list")


def _listed(path: Path, numbers: Sequence[str], known: set[str]) -> tuple[str, ...]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise InputError(f"can't read list {path}: {getattr(error, 'strerror', None) or error}") from error
    found: dict[str, None] = {}
    for line, text in enumerate(lines, start=1):
        name = text.partition("#")[0].strip()
        if name:
            found[_known(name, f"{path}, line {line}", numbers, known)] = None
    return tuple(found)


def _known(name: str, where: str, numbers: Sequence[str], known: set[str]) -> str:
    """The number that a list means. Raises InputError naming the nearest one."""
    file = Path(name)
    number = file.stem.removeprefix("image") if file.suffix.lower() in IMAGES else name
    if number in known:
        return number
    near = get_close_matches(number, numbers, n=1, cutoff=0.5)
    raise InputError(f"{where}: there is no picture {number!r}" + (f"; did you mean {near[0]!r}?" if near else ""))


def _checked(split: Split, count: int, remedy: str) -> Split:
    for name, part in (("training", split.training), ("validation", split.validation)):
        if not part:
            raise InputError(f"{name} gets none of {count} pictures: {remedy}")
    return split


def save(path: Path, split: Split) -> None:
    """Write pictures.json. Raises InputError if it can't be written."""
    with atomic_write(path) as part:
        part.write_text(json.dumps(asdict(split), indent=1) + "\n", encoding="utf-8")


def load(path: Path) -> Split:
    """Read pictures.json. Raises InputError naming the file and its fault."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {one_line(error)}") from error
    names = ("training", "validation", "test")
    if not isinstance(table, dict) or set(table) != set(names) or not all(_are_numbers(table[each]) for each in names):
        raise InputError(f"{path} is damaged: it must have lists of numbers {', '.join(names)}")
    try:
        return Split(**{name: tuple(table[name]) for name in names})
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _are_numbers(values: object) -> bool:
    return isinstance(values, Iterable) and not isinstance(values, str) and all(isinstance(e, str) for e in values)
