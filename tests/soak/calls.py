"""A million calls of detect while the camera turns, tilts and rises: memory stays flat."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import cv2

from vm_embedded import Detector, Orientation, Settings
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera

from .detectors import resident_memory

MODEL = "ball"
_SETTLED = 0.05
"""Part of the calls after which memory must be flat."""

_SAMPLES = 1000
"""How often memory is read."""


@dataclass
class CallsReport:
    """calls: of detect. memory: of the process at equal steps [bytes]. detections: how many balls were found."""

    calls: int = 0
    seconds: float = 0.0
    detections: int = 0
    memory: list[int] = field(default_factory=list)

    @property
    def settled(self) -> list[int]:
        """Memory after the first 5 % [bytes]."""
        return self.memory[int(_SETTLED * len(self.memory)) :]

    @property
    def change(self) -> float:
        """Largest difference of memory from its median, after the first 5 %; a part of the median."""
        middle = median(self.settled)
        return max(abs(each - middle) for each in self.settled) / middle

    def __str__(self) -> str:
        least, most = min(self.settled) / 2**20, max(self.settled) / 2**20
        return (
            f"calls: {self.calls} in {self.seconds:.0f} s ({1e3 * self.seconds / self.calls:.2f} ms each), "
            f"{self.detections} balls found\n  memory after the first 5 %: {least:.1f} to {most:.1f} MiB, "
            f"at most {100.0 * self.change:.2f} % from its median"
        )


def orientation_of(call: int) -> Orientation:
    """The orientation of a call: all angles and the height change, and the steps never repeat."""
    return Orientation.from_roll_pitch(
        height=0.5 + 0.05 * math.sin(0.0101 * call),
        roll=0.15 * math.sin(0.0237 * call),
        pitch=0.35 + 0.25 * math.sin(0.0173 * call),
        yaw=math.remainder(0.011 * call, 2.0 * math.pi),
    )


def soak_calls(calls: int = 1_000_000, show: Callable[[float], None] = lambda _: None) -> CallsReport:
    """Detect balls in drawn images, each time with another orientation. show: is called with the part that is done."""
    cv2.setNumThreads(1)
    camera = SyntheticCamera(CameraSettings(width=320, height=240))
    images = [camera.draw(0.37 * at) for at in range(16)]
    detector = Detector.from_file(MODEL, Settings(max_distance=4.0))
    report = CallsReport(calls)
    step = max(calls // _SAMPLES, 1)
    began = time.monotonic()
    for call in range(calls):
        found = detector.detect(images[call % len(images)], orientation_of(call), camera.lens)
        report.detections += len(found)
        if call % step == step - 1:
            report.memory.append(resident_memory(os.getpid()))
            show((call + 1) / calls)
    report.seconds = time.monotonic() - began
    return report


def write_memory(report: CallsReport, path: Path) -> None:
    """Write the memory at each step as a table of two columns: calls and MiB."""
    step = report.calls / len(report.memory)
    rows = (f"{step * (at + 1):.0f}\t{each / 2**20:.2f}\n" for at, each in enumerate(report.memory))
    path.write_text("calls\tMiB\n" + "".join(rows))
