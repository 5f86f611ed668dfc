"""The checks of vm-doctor: each returns a finding about the machine or the configuration, and a command as the fix."""

from __future__ import annotations

import asyncio
import errno
import fcntl
import math
import os
import socket
import struct
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from urllib.parse import urlsplit

from ..cameras.camera import without_password
from ..cameras.open_camera import brings_lens_and_pose, is_live
from ..cameras.opencv import device_path
from ..cameras.ros.bags import is_bag
from ..errors import InputError, VisualMeshError, one_line
from ..geometry.lens_doubt import lens_doubt
from ..geometry.orientation import Orientation
from ..live.configuration import Configuration
from ..live.load_detector import check_height, prove_network
from ..network.model_file import ModelFile
from .camera_source import SourceFacts, check_pose_source, check_source
from .finding import BAD, GOOD, WARNING, Finding
from .openings import check_openings

OPENCV_PACKAGES = ("opencv-python", "opencv-python-headless", "opencv-contrib-python", "opencv-contrib-python-headless")

_VIDIOC_ENUM_FMT = 0xC0405602
_V4L2_FMTDESC = "=III32sI4I"
_V4L2_BUF_TYPE_VIDEO_CAPTURE = 1

_EARLIEST_TIME = 1735689600.0
"""Start of 2025, since 1970 [s]: a clock that shows less is wrong."""

_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtmp": 1935}
"""Usual ports of the addresses of cameras."""

_HIGHEST = 20.0
"""Height of a camera from which the pose is probably in other units [m]."""

_PATIENCE = 3.0
"""How long to wait for the host of a camera [s]."""


def run_checks(configuration: Configuration, root: Path = Path("/")) -> Iterator[Finding]:
    """Run all checks, one finding after another. root: folder with proc, sys and dev."""
    try:
        yield check_processor(root / "proc/cpuinfo")
        yield check_threads(configuration.detector.threads, len(os.sched_getaffinity(0)), os.cpu_count() or 1)
        yield check_governor(root / "sys/devices/system/cpu")
        yield check_opencv({each.name.lower() for each in metadata.distributions() if each.name})
        finding, model = check_model(configuration)
        yield finding
        source, fault = SourceFacts(), ""
        try:
            source = check_source(configuration)
        except VisualMeshError as error:
            fault = str(error)
        yield from check_cameras(configuration, root, fault)
        yield check_lens(configuration, source)
        yield check_pose(configuration, source, model)
        yield check_clock(root / "sys/devices/system/clocksource/clocksource0/current_clocksource", time.time())
        yield from check_openings(configuration)
    except OSError as error:
        yield Finding("machine", WARNING, one_line(error))


def check_processor(cpuinfo: Path) -> Finding:
    """Whether the processor has the vector instructions that make ONNX Runtime fast."""
    try:
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        return Finding("processor", WARNING, f"{cpuinfo} can't be read: {error.strerror}")
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    named = {name.strip(): value.strip() for name, value in fields.items()}
    is_arm = "Features" in named  # there, x86 has "flags"
    flags = set(named.get("Features" if is_arm else "flags", "").split())
    model = named.get("model name", "ARM" if is_arm else "unknown")
    needed = ("asimd",) if is_arm else ("avx2", "fma")
    missing = [name for name in needed if name not in flags]
    if missing:
        return Finding("processor", WARNING, f"{model} has no {' and no '.join(missing)}; detection will be slow")
    return Finding("processor", GOOD, f"{model}: {', '.join(needed)}{', avx512' if 'avx512f' in flags else ''}")


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
    found = [each for each in OPENCV_PACKAGES if each in installed]
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


def check_model(configuration: Configuration) -> tuple[Finding, ModelFile | None]:
    """Whether the model loads, passes its self-tests and finds its canary, in another process; and the model if so."""
    try:
        model, proved = asyncio.run(prove_network(configuration))
    except VisualMeshError as error:
        mend = "vm-detect --check-config tells whether it works after a change"
        return Finding("model", BAD, str(error), mend), None
    seen = f"{configuration.model}: {proved}, sha256 {model.sha256[:16]}..."
    if model.canary is None:
        return Finding(
            "model", WARNING, seen, "vm-export --canary IMAGE LENS writes a picture that it must find"
        ), model
    return Finding("model", GOOD, seen), model


def check_cameras(configuration: Configuration, root: Path, fault: str) -> Iterator[Finding]:
    """Whether each video device can be opened, and whether the configured camera exists.

    fault: why it can never work, empty if it can.
    """
    nodes = sorted((root / "dev").glob("video*"))
    for node in nodes:
        yield _check_video_device(node)
    source = configuration.camera.source
    if not source:
        yield Finding(
            "camera", WARNING, "no camera is configured", "vm-detect --camera SOURCE, or set [camera] source in vm.toml"
        )
        return
    device = device_path(source)
    if fault:
        yield Finding("camera", BAD, fault, "vm-detect --help lists the allowed cameras")
        return
    if device is not None and not (root / device.relative_to("/")).exists():
        there = ", ".join(str(each) for each in nodes) or "none"
        yield Finding("camera", BAD, f"{device} does not exist; video devices: {there}", "ls -l /dev/v4l/by-id/")
        return
    may_change = device is not None and "by-" not in str(device)
    shown = without_password(source)
    refused = _refused_connection(source)
    if refused:
        yield Finding("camera", BAD, f"{shown}: {refused}", "ping the host, and compare port and address")
        return
    yield Finding(
        "camera",
        WARNING if may_change else GOOD,
        f"{shown}: the number may change when cameras are plugged in again" if may_change else shown,
        "ls -l /dev/v4l/by-id/ and use one of these paths" if may_change else "",
    )


def _refused_connection(source: str) -> str:
    """Why the host of a camera's address can't be reached; empty if it can, and for other sources."""
    try:
        address = urlsplit(source)
        if address.scheme not in _PORTS or not address.hostname:
            return ""
        with socket.create_connection((address.hostname, address.port or _PORTS[address.scheme]), _PATIENCE):
            return ""
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:  # for example a port that is no number
        return str(error)


def _check_video_device(node: Path) -> Finding:
    if not os.access(node, os.R_OK | os.W_OK):
        return Finding(str(node), BAD, "this user may not open it", "sudo usermod -aG video $USER, then log in again")
    try:
        formats = pixel_formats(node)
    except OSError as error:
        busy = error.errno == errno.EBUSY
        return Finding(
            str(node), WARNING, f"can't read its formats: {error.strerror}", f"fuser -v {node}" if busy else ""
        )
    if not formats:
        return Finding(str(node), GOOD, "no images; another device of the same camera delivers them")
    return Finding(str(node), GOOD, f"delivers {', '.join(formats)}")


def pixel_formats(node: Path) -> list[str]:
    """Pixel formats (FOURCC) of a V4L2 device. Raises OSError."""
    descriptor = os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    found: list[str] = []
    try:
        while True:
            request = struct.pack(_V4L2_FMTDESC, len(found), _V4L2_BUF_TYPE_VIDEO_CAPTURE, 0, b"", 0, 0, 0, 0, 0)
            reply = fcntl.ioctl(descriptor, _VIDIOC_ENUM_FMT, request)
            found.append(struct.unpack(_V4L2_FMTDESC, reply)[4].to_bytes(4, "little").decode("ascii", "replace"))
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTTY):  # these end the list
            raise
        return found
    finally:
        os.close(descriptor)


def check_lens(configuration: Configuration, source: SourceFacts) -> Finding:
    """Whether the lens fits the images. source: what is known about them."""
    camera = configuration.camera.source
    file = source.lens_file or configuration.lens
    if source.lens_file is None and configuration.fov is not None:
        return Finding("lens", GOOD, f"{math.degrees(configuration.fov):g} degrees wide, without distortion")
    if file is None:
        if _brings_lens_and_pose(camera):
            return Finding("lens", GOOD, f"{camera} has its own")
        state = BAD if is_live(camera) else WARNING
        return Finding("lens", state, "no lens is configured", "vm-detect --lens FILE, or set lens in vm.toml")
    lens = file.lens
    size = lens.size or source.size
    doubt = None if size is None else lens_doubt(lens, size)
    if doubt is not None:
        return Finding("lens", WARNING, doubt.seen, doubt.remedy)
    if source.size is not None:
        try:
            lens.for_image(source.size)
        except VisualMeshError as error:
            mend = "calibrate at the camera's size, or set [camera] width and height to the lens size"
            return Finding("lens", BAD, str(error), mend)
    if source.lens_file is not None:
        return Finding("lens", GOOD, f"{source.lens_file.path} belongs to the first image")
    if lens.size is None:
        return Finding(
            "lens",
            WARNING,
            "the lens has no image size",
            "add it to the lens: size: [width, height] in YAML, size = [width, height] in TOML, image_width and "
            "image_height in a calibration",
        )
    fits = "the camera chooses its own size" if source.size is None else "fits the camera"
    return Finding("lens", GOOD, f"for {lens.size[0]} x {lens.size[1]} px; {fits}")


def check_pose(configuration: Configuration, source: SourceFacts, model: ModelFile | None) -> Finding:
    """Whether the detector gets the pose of the camera, and whether the object is not too large for it.

    source: what is known about the images. model: the network; None if it can't be used.
    """
    camera = configuration.camera.source
    if configuration.pose.source != "fixed":
        try:
            check_pose_source(configuration)
        except InputError as error:
            return Finding("pose", WARNING, str(error), "start vm-ros, or choose another --pose-source")
        return Finding("pose", GOOD, f"from {configuration.pose.source}")
    try:
        orientation = configuration.fixed_orientation()
    except VisualMeshError as error:
        return Finding("pose", BAD, str(error), "vm-detect --height M, or set height in [orientation] of vm.toml")
    if source.lens_file is not None and source.lens_file.orientation is not None:
        orientation = source.lens_file.orientation
    if orientation is not None:
        return _check_orientation(orientation, configuration, model)
    if _brings_lens_and_pose(camera):
        return Finding("pose", GOOD, f"{camera} has its own")
    return Finding(
        "pose",
        BAD if is_live(camera) else WARNING,
        "no pose of the camera is configured",
        "vm-detect --height M --pitch ANGLE, or --pose-source; or set them in vm.toml",
    )


def _check_orientation(orientation: Orientation, configuration: Configuration, model: ModelFile | None) -> Finding:
    pitch, roll = (round(math.degrees(each), 1) + 0.0 for each in (orientation.pitch, orientation.roll))
    seen = f"height {orientation.height:g} m, pitch {pitch:g} deg, roll {roll:g} deg"
    if orientation.height > _HIGHEST:
        return Finding("pose", WARNING, f"{seen}: few objects are visible from there", "heights are in meters")
    try:
        if model is not None:
            check_height(orientation, configuration.detector, model)
    except InputError as error:
        return Finding(
            "pose", BAD, str(error), "measure the height of the camera, and the radius (not the diameter) of the object"
        )
    return Finding("pose", GOOD, seen)


def _brings_lens_and_pose(source: str) -> bool:
    """Whether a source, live or not, needs no configured lens and pose."""
    return brings_lens_and_pose(source) or is_bag(source)


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
