"""Which settings suit this machine, and writing them into a configuration file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Image
from .bench import Run, measure
from .detector import Detector
from .errors import InputError
from .files import written_beside
from .lens import Lens
from .onnx_file import ModelFile
from .orientation import Orientation
from .settings import Settings

_STEPS = (0.02, 0.03, 0.05, 0.08)
"""Bucket steps [rad] that are tried: small ones look at fewer points, large ones are prepared less often."""

_WORTH_A_CORE = 0.8
"""Share of a call's time to which another thread must bring it: the robot has other work for its cores."""


def tuned(
    model: ModelFile,
    settings: Settings,
    threads: int,
    image: Image,
    lens: Lens,
    orientations: Sequence[Orientation],
) -> dict[str, Any]:
    """The fastest of the settings that leave the answers as they are, on a walk that is replayed.

    First threads, up to `threads`, and whether they spin; then the steps of the buckets, by the mean of all calls, cold
    ones too.
    """
    candidates = [replace(settings, threads=1, spinning=False)] + [
        replace(settings, threads=count, spinning=spinning)
        for count in range(2, threads + 1)
        for spinning in (False, True)
    ]
    best = candidates[0]
    times = dict(
        zip(
            candidates,
            (float(np.median(run.total)) for run in _runs(model, candidates, image, lens, orientations)),
            strict=True,
        )
    )
    for each in candidates[1:]:
        if times[each] < times[best] * (_WORTH_A_CORE if each.threads > best.threads else 1.0):
            best = each
    candidates = [replace(best, pitch_step=step, roll_step=step) for step in _STEPS]
    means = [float(run.total.mean()) for run in _runs(model, candidates, image, lens, orientations)]
    best = candidates[int(np.argmin(means))]
    return {name: getattr(best, name) for name in ("threads", "spinning", "pitch_step", "roll_step")}


def _runs(
    model: ModelFile, candidates: Sequence[Settings], image: Image, lens: Lens, orientations: Sequence[Orientation]
) -> list[Run]:
    return measure([Detector(model, each) for each in candidates], image, lens, orientations)


def write_settings(path: Path, settings: Mapping[str, Any]) -> None:
    """Set keys in the [detector] table of a vm.toml, or make one; all else in it, comments too, stays as it is.

    Raises InputError if the file can't be read or written, or its [detector] can't be edited line by line.
    """
    try:
        text = path.read_text(encoding="utf-8") if path.exists() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"can't read configuration {path}: {error}") from error
    edited = edited_settings(text, settings)
    try:
        before, after = tomllib.loads(text), tomllib.loads(edited)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"configuration {path} can't be edited: {error}") from error
    if after != {**before, "detector": {**before.get("detector", {}), **settings}}:
        raise InputError(f"configuration {path} can't be edited: write its settings as lines below [detector]")
    with written_beside(path) as part:
        part.write_text(edited, encoding="utf-8")


def edited_settings(text: str, settings: Mapping[str, Any]) -> str:
    """The text of a vm.toml with these keys in its [detector] table."""
    values = {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in settings.items()}
    lines = text.splitlines()
    header = re.compile(r"\s*\[\s*detector\s*\]\s*(#.*)?")
    start = next((number for number, line in enumerate(lines) if header.fullmatch(line)), None)
    if start is None:
        lines += [*([""] if lines else []), "[detector]"]
        start = len(lines) - 1
    end = next((n for n in range(start + 1, len(lines)) if lines[n].lstrip().startswith("[")), len(lines))
    missing = dict(values)
    for number in range(start + 1, end):
        name, equals, rest = lines[number].partition("=")
        if equals and name.strip() in missing:
            comment = re.search(r"\s*#.*", rest)
            lines[number] = f"{name.strip()} = {missing.pop(name.strip())}{comment.group() if comment else ''}"
    lines[start + 1 : start + 1] = [f"{name} = {value}" for name, value in missing.items()]
    return "\n".join(lines) + "\n"
