"""The fastest settings on this machine, among those that do not change the detections."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..detection.detector import Detector
from ..detection.settings import Settings
from ..network.model_file import ModelFile
from .measuring import Run, measure
from .workload import Workload

TUNED = ("threads", "spinning", "pitch_step", "roll_step")
"""The settings that are tuned."""

_STEPS = (0.02, 0.03, 0.05, 0.08)
"""Bucket steps to try [rad]: small ones look at fewer points, large ones are prepared less often."""

_WORTH_A_CORE = 0.8
"""More threads, or spinning ones, must bring a call's time down to this share: the robot needs its cores."""


def fastest_settings(
    model: ModelFile,
    settings: Settings,
    threads: int,
    work: Workload,
    progress: Callable[[int], None],
) -> dict[str, Any]:
    """The fastest values of TUNED on a walk, the other settings as given.

    It compares numbers of threads up to `threads`; then threads that spin or not; then bucket steps. Spinning is
    measured in separate walks, because spinning threads slow down the calls that follow. Bucket steps are compared by
    the mean over all calls, which includes cold ones. progress: see `measure`.
    """

    def runs(candidates: Sequence[Settings]) -> list[Run]:
        return measure(
            [Detector(model, each) for each in candidates], work.image, work.lens, work.orientations, progress
        )

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
