"""What is wrong with a machine, before it matters: each finding says what was seen, and the command that mends it."""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from ..cameras.open_camera import camera_opener
from ..cameras.opencv import device_path
from ..errors import VisualMeshError, one_line
from ..live.configuration import Configuration
from ..live.control import default_socket_path
from ..live.load_detector import load_checked_detector

GOOD, WARNING, BAD = "ok", "warning", "failure"

WHEELS = ("opencv-python", "opencv-python-headless", "opencv-contrib-python", "opencv-contrib-python-headless")

_ENUMERATE_FORMATS = 0xC0405602  # VIDIOC_ENUM_FMT
_DESCRIPTION = "=III32sI4I"  # struct v4l2_fmtdesc
_CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE

_OLDEST = 1735689600.0  # 2025: no clock that is right shows less


@dataclass(frozen=True)
class Finding:
    """about: what was looked at. state: GOOD, WARNING or BAD. seen: in words. mend: a command, if one helps."""

    about: str
    state: str
    seen: str
    mend: str = ""


def examine(configuration: Configuration, root: Path = Path("/")) -> Iterator[Finding]:
    """All findings. root: where /proc, /sys and /dev are."""
    yield processor(root / "proc/cpuinfo")
    yield affinity(configuration.detector.threads, len(os.sched_getaffinity(0)), os.cpu_count() or 1)
    yield governor(root / "sys/devices/system/cpu")
    yield wheels({each.name.lower() for each in metadata.distributions() if each.name})
    yield network(configuration)
    yield from camera(configuration, root)
    yield calibration(configuration)
    yield clock(root / "sys/devices/system/clocksource/clocksource0/current_clocksource", time.time())
    yield socket_folder(configuration)


def processor(cpuinfo: Path) -> Finding:
    """Whether the processor has what ONNX Runtime is fast with."""
    try:
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        return Finding("processor", WARNING, f"{cpuinfo} can't be read: {error.strerror}")
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    named = {name.strip(): value.strip() for name, value in fields.items()}
    flags = set(named.get("flags", "").split())
    model = named.get("model name", "unknown")
    missing = [name for name in ("avx2", "fma") if name not in flags]
    if missing:
        return Finding("processor", WARNING, f"{model} has no {' and no '.join(missing)}, and will be slow")
    extra = ", avx512" if "avx512f" in flags else ""
    return Finding("processor", GOOD, f"{model}: avx2, fma{extra}")


def affinity(threads: int, allowed: int, cores: int) -> Finding:
    """Whether there are as many cores as threads."""
    if threads > allowed:
        return Finding(
            "threads",
            WARNING,
            f"{threads} threads are configured, and this process may use {allowed} of {cores} cores",
            f"vm-detect --threads {allowed}, or CPUAffinity= in a drop-in of the unit",
        )
    return Finding("threads", GOOD, f"{threads} of the {allowed} cores that this process may use")


def governor(cpus: Path) -> Finding:
    """Whether cores slow down between frames."""
    found = {each.read_text().strip() for each in sorted(cpus.glob("cpu[0-9]*/cpufreq/scaling_governor"))}
    if not found:
        return Finding("governor", GOOD, "this machine has none that can be set")
    if found <= {"performance", "schedutil"}:
        return Finding("governor", GOOD, ", ".join(sorted(found)))
    return Finding(
        "governor",
        WARNING,
        f"{', '.join(sorted(found))}: cores that sleep between frames wake up slowly",
        "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
    )


def wheels(installed: set[str]) -> Finding:
    """Whether two packages have written over each other's cv2."""
    found = [each for each in WHEELS if each in installed]
    if len(found) > 1:
        return Finding(
            "OpenCV",
            BAD,
            f"{' and '.join(found)} are installed, and share their files",
            f"pip uninstall -y {' '.join(found)} && pip install opencv-python-headless",
        )
    return Finding("OpenCV", GOOD, f"{found[0]} {metadata.version(found[0])}" if found else "not from a wheel")


def network(configuration: Configuration) -> Finding:
    """Whether the model loads and answers its self-test."""
    try:
        detector = load_checked_detector(configuration)
    except VisualMeshError as error:
        return Finding("model", BAD, str(error), "vm-detect --check-config says whether it is mended")
    digest = detector.session.model.sha256
    return Finding("model", GOOD, f"{configuration.model}: self-test passed, sha256 {digest[:16]}...")


def camera(configuration: Configuration, root: Path) -> Iterator[Finding]:
    """Whether the configured camera is there and may be read, and which others are."""
    nodes = sorted((root / "dev").glob("video*"))
    for node in nodes:
        yield _node(node)
    source = configuration.camera.source
    if not source:
        yield Finding(
            "camera", WARNING, "none is configured", "vm-detect --camera SOURCE, or [camera] source in vm.toml"
        )
        return
    device = device_path(source)
    try:
        camera_opener(configuration.camera, configuration.detector.format != "bgr")
        if device is not None and not (root / device.relative_to("/")).exists():
            there = ", ".join(str(each) for each in nodes) or "no camera at all"
            yield Finding("camera", BAD, f"there is no {device}; there is {there}", "ls -l /dev/v4l/by-id/")
            return
    except VisualMeshError as error:
        yield Finding("camera", BAD, str(error), "vm-detect --help says what a camera may be")
        return
    moving = device is not None and "by-" not in str(device)
    yield Finding(
        "camera",
        WARNING if moving else GOOD,
        f"{source}{': numbers change when cameras are plugged in another order' if moving else ''}",
        "use a path of /dev/v4l/by-id/" if moving else "",
    )


def _node(node: Path) -> Finding:
    if not os.access(node, os.R_OK | os.W_OK):
        return Finding(
            str(node), BAD, "may not be opened by this user", "sudo usermod -aG video $USER, and log in again"
        )
    try:
        formats = formats_of(node)
    except OSError as error:
        busy = error.errno == errno.EBUSY
        return Finding(str(node), WARNING, f"can't be asked: {error.strerror}", f"fuser -v {node}" if busy else "")
    if not formats:
        return Finding(str(node), GOOD, "no pictures: another node of the same camera gives them")
    return Finding(str(node), GOOD, f"gives {', '.join(formats)}")


def formats_of(node: Path) -> list[str]:
    """Pixel formats (FOURCC) of a V4L2 device. Raises OSError."""
    descriptor = os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    found: list[str] = []
    try:
        while True:
            question = struct.pack(_DESCRIPTION, len(found), _CAPTURE, 0, b"", 0, 0, 0, 0, 0)
            answer = fcntl.ioctl(descriptor, _ENUMERATE_FORMATS, question)
            found.append(struct.unpack(_DESCRIPTION, answer)[4].to_bytes(4, "little").decode("ascii", "replace"))
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTTY):
            raise
        return found
    finally:
        os.close(descriptor)


def calibration(configuration: Configuration) -> Finding:
    """Whether the lens is for the pictures that are asked for."""
    lens, asked = configuration.lens, configuration.camera
    if lens is None:
        return Finding("lens", WARNING, "none is configured", "vm-detect --lens FILE, or lens in vm.toml")
    if lens.lens.size is None:
        return Finding(
            "lens", WARNING, "it does not say for which size of picture it is", "add size = [width, height] to it"
        )
    if not (asked.width and asked.height):
        return Finding("lens", GOOD, f"for {lens.lens.size[0]} x {lens.lens.size[1]} px; the camera's size is its own")
    try:
        lens.lens.for_image((asked.width, asked.height))
    except VisualMeshError as error:
        return Finding("lens", BAD, str(error), "calibrate at the camera's size, or ask it for the lens's")
    return Finding("lens", GOOD, f"for {lens.lens.size[0]} x {lens.lens.size[1]} px, as the camera is asked for")


def clock(source: Path, now: float) -> Finding:
    """Whether clocks are fast to read, and roughly right."""
    try:
        name = source.read_text().strip()
    except OSError:
        name = "unknown"
    if now < _OLDEST:
        return Finding(
            "clock", WARNING, f"it says {time.strftime('%Y-%m-%d', time.gmtime(now))}", "sudo timedatectl set-ntp true"
        )
    if name in ("hpet", "acpi_pm"):
        return Finding("clock", WARNING, f"{name} takes microseconds to read", "boot with clocksource=tsc")
    return Finding("clock", GOOD, f"read from {name}")


def socket_folder(configuration: Configuration) -> Finding:
    """Whether the status socket can be made."""
    path = Path(configuration.status.socket) if configuration.status.socket else default_socket_path()
    if not os.access(path.parent, os.W_OK):
        return Finding(
            "status socket", BAD, f"{path.parent} can't be written", f"sudo install -d -o $USER {path.parent}"
        )
    return Finding("status socket", GOOD, str(path))


def safely(configuration: Configuration) -> Iterator[Finding]:
    """As examine; what can't even be looked at is a finding too."""
    try:
        yield from examine(configuration)
    except OSError as error:
        yield Finding("machine", WARNING, one_line(error))
