"""The parts of a data set: training, validation to choose the best network, and test for its evaluation."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import read_bytes, read_regular, write_file

from .picture_lists import read_list

_DRAWS = 1 << 64
_HELD_OUT = "validation", "test"
_NAMED = 5  # pictures to name in a message


@dataclass(frozen=True)
class Split:
    """Numbers of the pictures of each part, in order. Raises InputError if two parts share a picture."""

    training: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for (name, numbers), (other, others) in combinations(asdict(self).items(), 2):
            shared = sorted(set(numbers).intersection(others))
            if shared:
                more = f" and {len(shared) - _NAMED} more" if len(shared) > _NAMED else ""
                raise InputError(f"{name} and {other} share pictures {', '.join(shared[:_NAMED])}{more}")


def split_by_seed(
    numbers: Sequence[str], validation: float, test: float, seed: int, earlier: Split | None = None
) -> Split:
    """Split pictures at random; `validation` and `test` are the approximate shares of these parts, from 0 to 1.

    The part of a picture depends only on the seed, the shares and its number, so new pictures never move the others.
    What `earlier` has for validation or test stays there. Raises InputError for shares that leave nothing for training,
    and if training or validation gets no picture.
    """
    if not (validation >= 0.0 and test >= 0.0 and validation + test < 1.0):
        raise InputError(
            f"shares of validation and test must be at least 0 and add up to less than 1, not {validation} and {test}"
        )
    parts: dict[str, list[str]] = {"training": [], "validation": [], "test": []}
    kept = {each: name for name in _HELD_OUT for each in getattr(earlier, name, ())}
    for number in numbers:
        drawn = _draw(seed, number)
        part = "validation" if drawn < validation else "test" if drawn < validation + test else "training"
        parts[kept.get(number, part)].append(number)
    split = Split(**{name: tuple(each) for name, each in parts.items()})
    return _checked(split, len(numbers), "change data.validation or data.split_seed")


def _draw(seed: int, number: str) -> float:
    """A pseudo-random number from 0 to 1."""
    digest = hashlib.sha256(f"{seed}:{number}".encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:8], "big") / _DRAWS


def split_by_lists(numbers: Sequence[str], training: Path | None, validation: Path | None, test: Path | None) -> Split:
    """Split pictures by lists, as `read_list` reads them.

    Without a list of its own, training gets all pictures that no list names; validation and test get none. Raises
    InputError for a picture that does not exist or is in two parts, and if training or validation gets no picture.
    """
    chosen = {
        name: () if path is None else read_list(path, numbers)
        for name, path in (("training", training), ("validation", validation), ("test", test))
    }
    if training is None:
        named = {*chosen["validation"], *chosen["test"]}
        chosen["training"] = tuple(each for each in numbers if each not in named)
    return _checked(Split(**chosen), len(numbers), "list its pictures in a file")


def _checked(split: Split, count: int, remedy: str) -> Split:
    for name, part in (("training", split.training), ("validation", split.validation)):
        if not part:
            raise InputError(f"{name} gets none of the {count} pictures: {remedy}")
    return split


def write_split(path: Path, split: Split) -> None:
    """Write pictures.json. Raises InputError if it can't be written."""
    write_file(path, json.dumps(asdict(split), indent=1) + "\n")


def read_split(path: Path) -> Split:
    """Read pictures.json. Raises InputError naming the file and its fault."""
    try:
        table = json.loads(read_bytes(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is damaged: {one_line(error)}") from error
    names = ("training", *_HELD_OUT)
    if not isinstance(table, dict) or set(table) != set(names) or not all(map(_are_numbers, table.values())):
        raise InputError(f"{path} is damaged: it must hold the lists {', '.join(names)}")
    try:
        return Split(**{name: tuple(table[name]) for name in names})
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def split_beside(model: Path, data: Path) -> Split | None:
    """The split of the training that made a network of the pictures in `data`, if its files are beside the network."""
    with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
        if json.loads(read_regular(model.with_name("run.json")))["data"] == str(data.resolve()):
            return read_split(model.with_name("pictures.json"))
    return None


def _are_numbers(values: object) -> bool:
    return isinstance(values, list) and all(isinstance(each, str) for each in values)
