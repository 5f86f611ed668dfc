"""The checks of vm-doctor of the machine: processor, cores, packages and clock."""

from __future__ import annotations

import time
from importlib import metadata
from pathlib import Path

from ..errors import one_line
from .finding import BAD, GOOD, WARNING, Finding
from .processor import read_processor

_OPENCV_PACKAGES = (
    "opencv-python",
    "opencv-python-headless",
    "opencv-contrib-python",
    "opencv-contrib-python-headless",
)

_EARLIEST_TIME = 1735689600.0
"""Start of 2025, since 1970 [s]: a clock that shows less is wrong."""


def check_processor(cpuinfo: Path) -> Finding:
    """Whether the processor has the vector instructions that make ONNX Runtime fast."""
    try:
        name, flags, is_arm = read_processor(cpuinfo)
    except OSError as error:
        return Finding("processor", WARNING, f"{cpuinfo} can't be read: {error.strerror}")
    needed = ("asimd",) if is_arm else ("avx2", "fma")
    missing = [each for each in needed if each not in flags]
    if missing:
        return Finding("processor", WARNING, f"{name} has no {' and no '.join(missing)}; detection will be slow")
    return Finding("processor", GOOD, f"{name}: {', '.join(needed)}{', avx512' if 'avx512f' in flags else ''}")


def check_threads(threads: int, allowed: int, cores: int) -> Finding:
    """Whether the process may use as many cores as it has threads."""
    if threads > allowed:
        return Finding(
            "threads",
            WARNING,
            f"{threads} threads are configured, but this process may use only {allowed} of {cores} cores",
            f"vm-detect --threads {allowed}, or set CPUAffinity= in a drop-in of the systemd unit",
        )
    return Finding("threads", GOOD, f"{threads} configured; this process may use {allowed} cores")


def check_governor(cpus: Path) -> Finding:
    """Whether the frequency governor slows cores down between frames."""
    try:
        found = {each.read_text().strip() for each in sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_governor"))}
    except OSError as error:
        return Finding("governor", WARNING, f"can't be read: {one_line(error)}")
    if not found:
        return Finding("governor", GOOD, "this machine has no frequency governor to set")
    if found <= {"performance", "schedutil"}:
        return Finding("governor", GOOD, ", ".join(sorted(found)))
    return Finding(
        "governor",
        WARNING,
        f"{', '.join(sorted(found))}: cores slow down between frames and speed up late",
        "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
    )


def check_opencv(installed: set[str]) -> Finding:
    """Whether two packages overwrote each other's cv2."""
    found = [each for each in _OPENCV_PACKAGES if each in installed]
    if len(found) > 1:
        return Finding(
            "OpenCV",
            BAD,
            f"{' and '.join(found)} are installed and overwrite each other",
            f"pip uninstall -y {' '.join(found)} && pip install opencv-python-headless",
        )
    return Finding(
        "OpenCV", GOOD, f"{found[0]} {metadata.version(found[0])}" if found else "not installed from a wheel"
    )


def check_clock(source: Path, now: float) -> Finding:
    """Whether the clock is fast to read and roughly right."""
    try:
        name = source.read_text().strip()
    except OSError:
        name = "unknown"
    if now < _EARLIEST_TIME:
        return Finding(
            "clock",
            WARNING,
            f"the date is wrong: {time.strftime('%Y-%m-%d', time.gmtime(now))}",
            "sudo timedatectl set-ntp true",
        )
    if name in ("hpet", "acpi_pm"):
        return Finding("clock", WARNING, f"{name} is slow to read", "boot with clocksource=tsc")
    return Finding("clock", GOOD, f"clock source {name}")
