"""Which settings suit this machine, and writing them into a configuration file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Image
from ..detection.detector import Detector
from ..detection.settings import Settings
from ..errors import InputError
from ..files import atomic_write, check_writable
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from ..network.model_file import ModelFile
from .measuring import Run, measure

TUNED = ("threads", "spinning", "pitch_step", "roll_step")
"""The settings that leave the answers as they are."""

_STEPS = (0.02, 0.03, 0.05, 0.08)
"""Bucket steps [rad] that are tried: small ones look at fewer points, large ones are prepared less often."""

_WORTH_A_CORE = 0.8
"""Share of a call's time to which more threads, or spinning ones, must bring it: the robot needs its cores."""


def tuned(
    model: ModelFile,
    settings: Settings,
    threads: int,
    image: Image,
    lens: Lens,
    orientations: Sequence[Orientation],
    done: Callable[[int], None] = lambda frames: None,
) -> dict[str, Any]:
    """The fastest of TUNED, on a walk that is replayed.

    First threads, up to `threads`; then whether they spin, measured apart, since spinning threads take their time from
    whoever comes next; then the steps of the buckets, by the mean of all calls, cold ones too.
    """

    def runs(candidates: Sequence[Settings]) -> list[Run]:
        return measure([Detector(model, each) for each in candidates], image, lens, orientations, done)

    def medians(candidates: Sequence[Settings]) -> list[float]:
        return [float(np.median(run.total)) for run in runs(candidates)]

    candidates = [replace(settings, threads=count, spinning=False) for count in range(1, threads + 1)]
    best, fastest = candidates[0], np.inf
    for each, time in zip(candidates, medians(candidates), strict=True):
        if time < _WORTH_A_CORE * fastest:
            best, fastest = each, time
    if best.threads > 1:
        spinning = replace(best, spinning=True)
        if medians([spinning])[0] < _WORTH_A_CORE * medians([best])[0]:
            best = spinning
    candidates = [replace(best, pitch_step=step, roll_step=step) for step in _STEPS]
    best = candidates[int(np.argmin([run.total.mean() for run in runs(candidates)]))]
    return {name: getattr(best, name) for name in TUNED}


def check_editable(path: Path) -> None:
    """Raise InputError if `write_settings` would."""
    check_writable(path)
    _edited(path, dict.fromkeys(TUNED, 1))


def write_settings(path: Path, settings: Mapping[str, Any]) -> None:
    """Set keys in the [detector] table of a vm.toml, or make one; all else in it, comments too, stays as it is.

    Raises InputError if the file can't be read or written, or its [detector] can't be edited line by line.
    """
    edited = _edited(path, settings)
    with atomic_write(path) as part:
        part.write_bytes(edited.encode("utf-8"))


def _edited(path: Path, settings: Mapping[str, Any]) -> str:
    try:
        text = path.read_bytes().decode("utf-8") if path.exists() else ""
        before = tomllib.loads(text)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"can't read configuration {path}: {error}") from error
    edited = edited_settings(text, settings)
    try:
        after = tomllib.loads(edited)
    except tomllib.TOMLDecodeError:
        after = {}
    detector = before.get("detector", {})
    if not isinstance(detector, dict) or after != {**before, "detector": {**detector, **settings}}:
        raise InputError(f"configuration {path} can't be edited: write its settings as lines below [detector]")
    return edited


def edited_settings(text: str, settings: Mapping[str, Any]) -> str:
    """The text of a vm.toml with these keys in its [detector] table."""
    values = {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in settings.items()}
    end = "\r\n" if "\r\n" in text else "\n"
    lines = text.removesuffix(end).split(end) if text else []
    header = re.compile(r"\s*\[\s*detector\s*\]\s*(#.*)?")
    start = next((number for number, line in enumerate(lines) if header.fullmatch(line)), None)
    if start is None:
        lines += [*([""] if lines else []), "[detector]"]
        start = len(lines) - 1
    behind = next((n for n in range(start + 1, len(lines)) if lines[n].lstrip().startswith("[")), len(lines))
    missing = dict(values)
    for number in range(start + 1, behind):
        name, equals, rest = lines[number].partition("=")
        if equals and name.strip() in missing:
            comment = re.search(r"\s*#.*", rest)
            lines[number] = f"{name.strip()} = {missing.pop(name.strip())}{comment.group() if comment else ''}"
    lines[start + 1 : start + 1] = [f"{name} = {value}" for name, value in missing.items()]
    return end.join(lines) + end
