"""Reports on a set of pictures: as tables, as JSON, and its problems."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from itertools import pairwise
from textwrap import wrap
from typing import Any

from vm_workstation.text_tables import aligned, summary

from ..scene.configuration import CLASSES
from .inspection import Facts, Inspection, ObjectFacts

_LISTED = 20
"""Largest number of faults, and of gaps, that are listed."""

_WIDTH = 100  # characters of a line
_NO_BREAK = "\xa0"  # a space at which lines are not wrapped


def quantities(facts: Sequence[Facts]) -> dict[str, list[float]]:
    """The values of all pictures, by name with unit. Values of objects are those of all objects."""
    objects, name = objects_of(facts), object_name(facts)
    found = {
        "camera height [m]": [each.height for each in facts],
        "camera pitch [deg]": [math.degrees(each.pitch) for each in facts],
        "camera roll [deg]": [math.degrees(each.roll) for each in facts],
        f"{name} distance [m]": [each.distance for each in objects],
        f"{name} radius [px]": [each.pixel_radius for each in objects],
        f"{name} visible [%]": [100.0 * each.visible for each in objects],
    }
    if any(each.shares for each in facts):
        for each_class in (*CLASSES, "unlabeled"):
            found[f"{each_class} pixels [%]"] = [100.0 * each.shares[each_class] for each in facts]
    return {name: values for name, values in found.items() if values}


def categories(facts: Sequence[Facts]) -> dict[str, Counter[str]]:
    """The number of pictures in each category, by property; of objects in each state if there are several."""
    name = object_name(facts)
    balls = {
        "other ball": Counter(each.other_ball or "none" for each in facts),
        "ball design": Counter(each.kind for each in objects_of(facts)),
    }
    return {
        "ground": Counter(each.ground for each in facts),
        "lens": Counter(each.projection for each in facts),
        name: Counter(state for each in facts for state in _states(each)),
        **(balls if name == "ball" else {}),
        "map": Counter(each.map for each in facts),
    }


def objects_of(facts: Sequence[Facts]) -> list[ObjectFacts]:
    """The objects to detect of all pictures."""
    return [shown for each in facts for shown in each.objects]


def object_name(facts: Sequence[Facts]) -> str:
    """The class of the objects to detect."""
    return facts[0].object_name if facts else "ball"


def _states(facts: Facts) -> list[str]:
    """How much of each object to detect is visible; none for a picture without one."""
    return [_state(each) for each in facts.objects] or ["none"]


def _state(shown: ObjectFacts) -> str:
    if shown.visible <= 0.0:
        return "hidden"
    return "whole" if shown.visible > 0.98 else "in part"


def as_json(found: Inspection) -> dict[str, Any]:
    """All findings, for JSON."""
    return {
        "count": found.count,
        "done": len(found.done),
        "missing": found.missing,
        "faults": [asdict(each) for each in found.faults],
        "quantities": {name: summary(values) for name, values in quantities(found.facts).items()},
        "categories": {name: dict(counts.most_common()) for name, counts in categories(found.facts).items()},
        "pictures": [asdict(each) for each in found.facts],
    }


def tables(found: Inspection) -> str:
    """Tables as text: the progress, and what the pictures show."""
    parts = [f"{len(found.done)} of {found.count} pictures exist, {len(found.faults)} of them are invalid"]
    if found.facts:
        parts += [_quantity_table(found.facts), _category_table(found)]
    return "\n\n".join(parts)


def _quantity_table(facts: Sequence[Facts]) -> str:
    rows = []
    for name, values in quantities(facts).items():
        numbers = summary(values)
        rows.append([name, *(_short(each) for each in numbers.values())])
    return "\n".join(aligned([["", *numbers], *rows]))


def _short(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.1f}"


def _category_table(found: Inspection) -> str:
    lines = []
    for name, counts in categories(found.facts).items():
        total = sum(counts.values())
        if name == "map":
            unused = sorted(set(found.plan.get("maps", {})).difference(counts))
            text = f"{len(counts)} used, each in {min(counts.values())} to {max(counts.values())} pictures"
            text += f"; not used: {', '.join(unused)}" if unused else ""
        else:
            items = (f"{kind} {n} ({100.0 * n / total:.1f} %)" for kind, n in counts.most_common())
            text = ", ".join(item.replace(" ", _NO_BREAK) for item in items)
        if total:
            wrapped = wrap(text, _WIDTH, initial_indent=f"{name:<13}", subsequent_indent=13 * " ")
            lines += [line.replace(_NO_BREAK, " ") for line in wrapped]
    return "\n".join(lines)


def problems(found: Inspection) -> list[str]:
    """Lines on missing and invalid pictures and how to fix them; empty if the set is complete."""
    lines = [f"picture {each.index}: {each.text}" for each in found.faults[:_LISTED]]
    if len(found.faults) > _LISTED:
        lines.append(f"and {len(found.faults) - _LISTED} more invalid pictures; --json lists all")
    if found.faults:
        lines.append("to render these again, delete their scene*.json and repeat the command that rendered the set")
    missing = found.missing
    if missing:
        runs = [f"{first}" if first == last else f"{first} to {last}" for first, last in runs_of(missing)]
        more = f" and {len(runs) - _LISTED} more gaps" if len(runs) > _LISTED else ""
        lines.append(f"missing pictures ({len(missing)}): {', '.join(runs[:_LISTED])}{more}")
        shard = shard_of_missing(missing)
        if shard is not None:
            lines.append(f"all missing pictures belong to shard {shard[0]}/{shard[1]}")
        lines.append("to render these, repeat the command that rendered the set")
    return lines


def runs_of(numbers: Iterable[int]) -> list[tuple[int, int]]:
    """The runs of successive numbers in a sorted sequence, each as (first, last)."""
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and number == found[-1][1] + 1:
            found[-1] = (found[-1][0], number)
        else:
            found.append((number, number))
    return found


def shard_of_missing(missing: Sequence[int]) -> tuple[int, int] | None:
    """The shard (I, N) with the largest N that contains all missing numbers, or None.

    A shard that was not started, or stopped early, leaves such gaps.
    """
    step = math.gcd(*(after - before for before, after in pairwise(missing)))
    return (missing[0] % step + 1, step) if step > 1 and len(missing) > 2 else None
