"""A summary of boxed pictures: recordings, sizes, and the boxes of each class."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from statistics import median
from typing import Any

from vm_workstation.text_tables import aligned

from .box import Box, BoxedPicture, BoxedSet
from .findings import NO_NAME, Finding

_ALIKE = 0.75
"""Similarity of names, from 0 to 1, from which on one may be a misspelling of the other."""


def summary_lines(found: BoxedSet) -> Iterator[str]:
    """Lines about the usable pictures: their numbers, sizes and recordings, and a table of classes."""
    pictures = found.pictures
    recordings = Counter(each.recording for each in pictures)
    yield f"{len(pictures)} pictures can be used, of {len(recordings)} recordings; {_counts(found)}"
    if not pictures:
        return
    sizes = Counter(each.size for each in pictures).most_common()
    yield "size   " + ", ".join(f"{width} x {height} px {count}" for (width, height), count in sizes)
    counts = sorted(recordings.values())
    yield f"pictures of a recording: {counts[0]} to {counts[-1]}, median {median(counts):g}"
    yield f"with a lens file: {sum(each.lens is not None for each in pictures)}"
    yield f"without boxes: {sum(not each.boxes for each in pictures)}"
    rows = [
        [name, *(str(each[key]) for key in ("boxes", "pictures")), _range(each["width"]), _range(each["height"])]
        for name, each in classes_of(found).items()
    ]
    if rows:
        yield ""
        yield from aligned([["class", "boxes", "pictures", "width [px]", "height [px]"], *rows])


def classes_of(found: BoxedSet) -> dict[str, dict[str, Any]]:
    """For each class: numbers of boxes and pictures, and least, median and largest width and height [px]."""
    result = {}
    for name in found.names:
        shown = [_of_class(each, name) for each in found.pictures]
        boxes = [box for some in shown for box in some]
        result[name] = {
            "boxes": len(boxes),
            "pictures": sum(bool(some) for some in shown),
            "width": _extent([box.width for box in boxes]),
            "height": _extent([box.height for box in boxes]),
        }
    return result


def name_faults(found: BoxedSet, objects: Sequence[str]) -> list[Finding]:
    """Faults about names of classes: near those of a network's objects but different, or none of these.

    objects: the classes of objects that the network finds.
    """
    findings = []
    for name in found.names:
        near = get_close_matches(name.lower(), objects, n=1, cutoff=_ALIKE)
        if near and name not in objects:
            where = [each for each in found.pictures if _of_class(each, name)]
            count = sum(len(_of_class(each, name)) for each in where)
            text = (
                f"class {name!r} ({count} box{'es' * (count > 1)}, the first in {where[0].image.name}): did you mean "
                f"{near[0]!r}? Rename it with --names '{name}={near[0]}'"
            )
            findings.append(Finding(NO_NAME, text))
    if found.pictures and not set(found.names) & set(objects):
        there = ", ".join(found.names) or "there are no boxes"
        text = (
            f"no box of class {' or '.join(objects)}, which the network finds (classes: {there}): "
            f"rename one with --names NAME={objects[0]}"
        )
        findings.append(Finding(NO_NAME, text))
    return findings


def rename_advice(counts: Counter[str], name: str) -> str:
    """How to give boxes the name of a network's class that none has. counts: the number of boxes of each class."""
    found = ", ".join(f"{each} ({count})" for each, count in counts.most_common()) or "no boxes"
    near = list(counts) if len(counts) == 1 else get_close_matches(name.lower(), counts, n=1, cutoff=0.5)
    return f"it has {found}. Rename the class of these objects: --names {near[0] if near else 'NAME'}={name}"


def _counts(found: BoxedSet) -> str:
    faults, remarks = len(found.faults), len(found.remarks)
    said = f"{faults} fault{'s' * (faults != 1)}"
    return f"{said}, {remarks} remark{'s' * (remarks != 1)}" if remarks else said


def _of_class(picture: BoxedPicture, name: str) -> list[Box]:
    return [box for box in picture.boxes if box.name == name]


def _extent(values: Sequence[float]) -> tuple[float, float, float]:
    return min(values), median(values), max(values)


def _range(values: tuple[float, float, float]) -> str:
    low, middle, high = values
    return f"{low:.1f} to {high:.1f}, median {middle:.1f}"
