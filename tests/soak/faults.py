"""Each kind of camera fault a thousand times: no stale detection, well again every time, and memory stays flat.

Detectors run side by side, each on a camera of its own, which has all kinds of faults in any order.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .detectors import Detector, detector, status
from .failing_camera import KINDS, Fault

MAX_AGE_MS = 200.0
QUICK = ("--camera-lost-ms", 250, "--camera-open-ms", 500, "--camera-retry-ms", 20, "--camera-longest-retry-ms", 80)
SMALL = ("--camera-width", 320, "--camera-height", 240, "--camera-fps", 12, "--camera-max-age-ms", MAX_AGE_MS)

HARMFUL = ("frozen", "truncated", "ahead", "behind", "empty", "depth")
"""Faults whose frames must never be reported."""

_SETTLED = 0.1
"""Part of a soak after which memory must be flat."""

_PARTS = 9
"""Parts of the rest, whose memory is compared."""

_OFTEN = 0.9
"""Share of a part's seconds in which the memory is at most what counts. The allocator gives some MiB back and takes
them again seconds later, so a median depends on how long it waits."""


@dataclass
class FaultReport:
    """What became of all faults.

    faults, recovered: by their kind, all of them and those after which the state was ok before the next one. frames:
    how many were reported. unexpected: frames that must not be reported and lines that must not be written. memory: of
    each detector at every second [bytes]. left: threads and descriptors that a detector had in the end and not in the
    beginning. rejected: frames that the detectors did not report, by reason.
    """

    faults: Counter[str] = field(default_factory=Counter)
    recovered: Counter[str] = field(default_factory=Counter)
    frames: int = 0
    unexpected: list[str] = field(default_factory=list)
    memory: list[list[int]] = field(default_factory=list)
    left: int = 0
    rejected: Counter[str] = field(default_factory=Counter)
    seconds: float = 0.0

    def growth(self, settled: float = _SETTLED, parts: int = _PARTS) -> float:
        """The largest growth of a detector's memory [MiB], see the function `growth`."""
        return max(growth(each, settled, parts) for each in self.memory) / 2**20

    def __str__(self) -> str:
        rows = [
            f"  {kind:10} {count:6} faults, recovered {self.recovered[kind]}" for kind, count in self.faults.items()
        ]
        return "\n".join(
            [
                f"faults: {sum(self.faults.values())} in {self.seconds:.0f} s, {len(self.memory)} detectors",
                *rows,
                f"  {self.frames} frames reported, not reported {dict(self.rejected)}",
                f"  stale frames and unexpected lines: {len(self.unexpected)}",
                f"  memory of each detector changes by at most {self.growth():.1f} MiB; "
                f"threads and descriptors left: {self.left}",
                *self.unexpected[:10],
            ]
        )


def is_fresh(message: Mapping[str, Any]) -> bool:
    """Whether a frame may be reported."""
    fault = message.get("truth", {}).get("fault")
    if fault == "blank" and message["detections"]:
        return False
    return message["age_ms"] <= MAX_AGE_MS and fault not in HARMFUL


def soak_faults(
    folder: Path,
    detectors: int = 12,
    count: int = 84 * len(KINDS),
    seed: int = 1,
    pause: float = 1.6,
    first: float = 30.0,
    show: Callable[[float], None] = lambda _: None,
) -> FaultReport:
    """Run detectors side by side, each with `count` faults.

    pause: between two faults [s]. first: when the first one begins, after all detectors have started [s]. show: is
    called with the part that is done. Raises TimeoutError if a detector is not well before the first fault or after the
    last one.
    """
    report = FaultReport()
    scripts = [random_faults(count, seed + at, pause, first) for at in range(detectors)]
    began = time.monotonic()
    with ExitStack() as stack:
        running = [
            stack.enter_context(detector(folder / str(at), *QUICK, *SMALL, faults=faults, check_frame=is_fresh))
            for at, faults in enumerate(scripts)
        ]
        for each in running:
            each.wait(each.is_ok)
        time.sleep(1.0)
        things = [each.open_things() for each in running]
        report.memory = [[] for _ in running]
        last = max(
            each.ready + faults[-1].at + faults[-1].seconds for each, faults in zip(running, scripts, strict=True)
        )
        total = last - time.time()
        while (left := last - time.time()) > 0.0:
            show(1.0 - left / total)
            for each, kept in zip(running, report.memory, strict=True):
                kept.append(each.resident())
            time.sleep(1.0)
        for at, (each, faults, before) in enumerate(zip(running, scripts, things, strict=True)):
            each.wait(each.is_ok)
            for name in ("broken", "frozen", "ahead", "late", "failed", "reconnects"):
                report.rejected[name] += status(folder / str(at))["counts"][name]
            report.left += _left(each, before)
            report.unexpected += [] if each.stop() == 0 else ["exit status is not 0"]
            report.unexpected += each.unexpected
            report.frames += each.frames
            report.faults.update(fault.kind for fault in faults)
            report.recovered.update(recovered(each, faults))
    report.seconds = time.monotonic() - began
    return report


def random_faults(count: int, seed: int, pause: float, first: float) -> Sequence[Fault]:
    """Faults of 0.1 to 0.4 s, one after another; all kinds are equally frequent. first, pause: see soak_faults."""
    random = np.random.default_rng(seed)
    kinds = np.resize(list(KINDS), count)
    random.shuffle(kinds)
    faults, at = [], first
    for kind in kinds.tolist():
        faults.append(Fault(kind, at, float(random.uniform(0.1, 0.4))))
        at += faults[-1].seconds + pause
    return faults


def recovered(found: Detector, faults: Sequence[Fault]) -> list[str]:
    """The kinds of the faults after which the state was ok before the next one began."""
    changes = [(at - found.ready, state) for at, state in found.states]
    begins = [*(each.at for each in faults[1:]), math.inf]
    kinds, at, state = [], 0, ""
    for fault, next_one in zip(faults, begins, strict=True):
        while at < len(changes) and changes[at][0] < fault.at + fault.seconds:
            state, at = changes[at][1], at + 1
        is_well = state == "ok"
        while at < len(changes) and changes[at][0] < next_one:
            state, at = changes[at][1], at + 1
            is_well = is_well or state == "ok"
        if is_well:
            kinds.append(fault.kind)
    return kinds


def growth(memory: Sequence[int], settled: float = _SETTLED, parts: int = _PARTS) -> int:
    """Largest difference between the memory of parts of the time, without the first part `settled` [bytes].

    The memory of a part is what it has at most in nine of ten seconds.
    """
    rest = np.array(memory[int(settled * len(memory)) :])
    levels = [np.quantile(each, _OFTEN, method="lower") for each in np.array_split(rest, parts) if each.size]
    return int(max(levels) - min(levels))


def _left(found: Detector, before: tuple[int, int]) -> int:
    """How many threads and descriptors are still open that were not at the beginning."""
    deadline = time.monotonic() + 20.0
    while (left := sum(max(now - then, 0) for now, then in zip(found.open_things(), before, strict=True))) > 0:
        if time.monotonic() > deadline:
            break
        time.sleep(0.1)
    return left
