"""What a set of pictures holds, as tables and for other programs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from textwrap import wrap
from typing import Any

from vm_workstation.text_tables import aligned, summary

from ..scene.configuration import CLASSES
from .inspection import Facts, Inspection, shard_that_lacks, spans

_NAMED = 20
"""Faults and runs of missing pictures that are named."""

_WIDTH = 100  # of lines
_JOINED = "\xa0"  # a space that lines are not broken at


def quantities(facts: Sequence[Facts]) -> dict[str, list[float]]:
    """Numbers of the pictures, each by its name with unit; those of balls only where there is one."""
    balls = [each.ball for each in facts if each.ball is not None]
    found = {
        "camera height [m]": [each.height for each in facts],
        "camera pitch [deg]": [math.degrees(each.pitch) for each in facts],
        "camera roll [deg]": [math.degrees(each.roll) for each in facts],
        "ball distance [m]": [each.distance for each in balls],
        "ball radius [px]": [each.pixel_radius for each in balls],
        "ball visible [%]": [100.0 * each.visible for each in balls],
    }
    if any(each.shares for each in facts):
        for name in (*CLASSES, "unlabeled"):
            found[f"{name} pixels [%]"] = [100.0 * each.shares[name] for each in facts]
    return {name: values for name, values in found.items() if values}


def categories(facts: Sequence[Facts]) -> dict[str, Counter[str]]:
    """How many pictures there are of each kind, by what is told apart."""
    return {
        "ground": Counter(each.ground for each in facts),
        "lens": Counter(each.projection for each in facts),
        "ball": Counter(_ball_state(each) for each in facts),
        "other ball": Counter(each.other_ball or "none" for each in facts),
        "ball design": Counter(each.ball.kind for each in facts if each.ball is not None),
        "map": Counter(each.map for each in facts),
    }


def _ball_state(facts: Facts) -> str:
    if facts.ball is None:
        return "none"
    if facts.ball.visible <= 0.0:
        return "hidden"
    return "whole" if facts.ball.visible > 0.98 else "in part"


def as_json(found: Inspection) -> dict[str, Any]:
    """All findings for other programs."""
    return {
        "count": found.count,
        "done": len(found.done),
        "missing": found.missing,
        "faults": [asdict(each) for each in found.faults],
        "quantities": {name: summary(values) for name, values in quantities(found.facts).items()},
        "categories": {name: dict(counts.most_common()) for name, counts in categories(found.facts).items()},
        "pictures": [asdict(each) for each in found.facts],
    }


def tables(found: Inspection, shards: int = 1) -> str:
    """A set's tables as text: how much is done, by shards if it has several, and what its pictures show."""
    parts = [_progress(found, shards)]
    if found.facts:
        parts += [_quantity_table(found.facts), _category_table(found)]
    return "\n\n".join(parts)


def _progress(found: Inspection, shards: int) -> str:
    lines = [f"{len(found.done)} of {found.count} pictures are there, {len(found.faults)} of them at fault"]
    if shards > 1:
        rows = []
        for number in range(shards):
            own = range(number, found.count, shards)
            there = sum(index % shards == number for index in found.done)
            bad = sum(each.index % shards == number for each in found.faults)
            rows.append([f"{number + 1}/{shards}", str(there), str(len(own)), str(bad)])
        lines += ["", *aligned([["shard", "there", "of", "at fault"], *rows])]
    return "\n".join(lines)


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
            text = f"{len(counts)} used, each by {min(counts.values())} to {max(counts.values())} pictures"
            text += f"; not used: {', '.join(unused)}" if unused else ""
        else:
            items = (f"{kind} {n} ({100.0 * n / total:.1f} %)" for kind, n in counts.most_common())
            text = ", ".join(item.replace(" ", _JOINED) for item in items)
        if total:
            wrapped = wrap(text, _WIDTH, initial_indent=f"{name:<13}", subsequent_indent=13 * " ")
            lines += [line.replace(_JOINED, " ") for line in wrapped]
    return "\n".join(lines)


def complaints(found: Inspection) -> list[str]:
    """Lines on what is missing or at fault and how to mend it; none if all is well."""
    lines = [f"picture {each.index}: {each.text}" for each in found.faults[:_NAMED]]
    if len(found.faults) > _NAMED:
        lines.append(f"and {len(found.faults) - _NAMED} more pictures at fault; --json lists all")
    if found.faults:
        lines.append("to mend these, delete their scene*.json and run the command again that renders the set")
    missing = found.missing
    if missing:
        runs = [f"{first}" if first == last else f"{first} to {last}" for first, last in spans(missing)]
        more = f" and {len(runs) - _NAMED} more gaps" if len(runs) > _NAMED else ""
        lines.append(f"{len(missing)} pictures are not there yet: {', '.join(runs[:_NAMED])}{more}")
        shard = shard_that_lacks(missing)
        if shard is not None:
            lines.append(f"all of them belong to shard {shard[0]}/{shard[1]}")
        lines.append("run the command again that renders the set; it goes on from here")
    return lines
