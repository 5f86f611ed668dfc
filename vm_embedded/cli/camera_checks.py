"""The checks of vm-doctor of the cameras: those of the machine, and the configured one."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import struct
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

from ..borders.credentials import password_hint, without_password
from ..cameras.camera import CameraSettings, Shot
from ..cameras.grabber import Grabber
from ..cameras.open_camera import brings_lens_and_pose, camera_opener, is_live
from ..cameras.opencv import device_path
from .finding import BAD, GOOD, WARNING, Finding

_VIDIOC_ENUM_FMT = 0xC0405602
_V4L2_FMTDESC = "=III32sI4I"
_V4L2_BUF_TYPE_VIDEO_CAPTURE = 1

_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtmp": 1935}
"""Usual ports of the addresses of cameras."""

_FRAMES, _MOST_REJECTED = 5, 20
"""Frames that show that a camera works, and rejected ones that show that it does not."""

_PATIENCE = 3.0
"""How long to wait for the host of a camera [s]."""


def check_cameras(
    camera: CameraSettings, raw: bool, fault: str, is_running: bool, dev: Path, shots: list[Shot]
) -> Iterator[Finding]:
    """Whether each video device can be opened, and whether the configured camera delivers frames.

    camera, raw: as for `camera_opener`. fault: why it can never work, empty if it can. is_running: whether a detector
    reads it now; many cameras serve only one reader. dev: folder with the devices. shots: gets the frames.
    """
    source = camera.source
    nodes = sorted(dev.glob("video*"))
    for node in nodes:
        yield _check_video_device(node)
    if not source:
        yield Finding(
            "camera", WARNING, "no camera is configured", "vm-detect --camera SOURCE, or set [camera] source in vm.toml"
        )
    elif fault:
        yield Finding("camera", BAD, fault, "vm-detect --help lists the allowed cameras")
    elif (device := device_path(source)) is not None:
        finding = _check_configured_device(source, device, nodes, dev)
        yield finding
        if finding.state != BAD and not is_running and dev == Path("/dev"):
            yield _check_frames(camera, raw, shots)
    elif not is_live(source) or brings_lens_and_pose(source):
        yield Finding("camera", GOOD, source)
    elif refused := _refused_connection(source):
        yield Finding(
            "camera", BAD, f"{without_password(source)}: {refused}", "ping the host, and compare port and address"
        )
    elif is_running:
        yield Finding("camera", GOOD, f"{without_password(source)}; a detector is running")
    else:
        yield _check_frames(camera, raw, shots)


def _check_configured_device(source: str, device: Path, nodes: Sequence[Path], dev: Path) -> Finding:
    """Whether the configured device exists. nodes: the video devices of the machine."""
    if not (dev / device.relative_to("/dev")).exists():
        there = ", ".join(map(str, nodes)) or "none"
        return Finding("camera", BAD, f"{device} does not exist; video devices: {there}", "ls -l /dev/v4l/by-id/")
    if "by-" in str(device):
        return Finding("camera", GOOD, source)
    return Finding(
        "camera",
        WARNING,
        f"{source}: the number may change when cameras are plugged in again",
        "ls -l /dev/v4l/by-id/ and use one of these paths",
    )


def _check_frames(camera: CameraSettings, raw: bool, shots: list[Shot]) -> Finding:
    """Whether the camera delivers frames that can be used, read and decoded as by a detector."""
    grabber, shown = Grabber(camera_opener(camera, raw), camera, lambda: None), without_password(camera.source)
    began = time.monotonic()
    grabber.start()
    counts = grabber.counts
    while counts.grabbed < _FRAMES and counts.rejected < _MOST_REJECTED and not grabber.ended:
        shot = grabber.take()
        if shot is not None:
            shots.append(shot)
        lost = grabber.supervise(time.monotonic())
        if lost and grabber.trouble and (counts.reconnects or time.monotonic() - began > _PATIENCE):
            break
        time.sleep(0.01)
    grabber.stop(_PATIENCE)
    if not counts.grabbed:
        return Finding("camera", BAD, f"{shown} delivers no frame: {grabber.trouble}", "look at it in a browser or VLC")
    if counts.rejected:
        seen = (
            f"{shown}: {counts.rejected} of {counts.grabbed + counts.rejected} frames can't be used: {grabber.trouble}"
        )
        return Finding("camera", WARNING, seen, "check cable and network of the camera")
    height, width = shots[-1].image.shape[:2]
    return Finding("camera", GOOD, f"{shown} delivers frames of {width} x {height} px")


def _refused_connection(source: str) -> str:
    """Why the host of a camera's address can't be reached; empty if it can, and for other sources."""
    try:
        address = urlsplit(source)
        if address.scheme not in _PORTS or not address.hostname:
            return ""
        with socket.create_connection((address.hostname, address.port or _PORTS[address.scheme]), _PATIENCE):
            return ""
    except OSError as error:
        return f"{error.strerror or error}{password_hint(source)}"
    except ValueError as error:  # for example a port that is no number; the error may quote a password
        return f"the address is not valid{password_hint(source)}" if "@" in source else str(error)


def _check_video_device(node: Path) -> Finding:
    if not os.access(node, os.R_OK | os.W_OK):
        return Finding(str(node), BAD, "this user may not open it", "sudo usermod -aG video $USER, then log in again")
    try:
        formats = _pixel_formats(node)
    except OSError as error:
        busy = error.errno == errno.EBUSY
        return Finding(
            str(node), WARNING, f"can't read its formats: {error.strerror}", f"fuser -v {node}" if busy else ""
        )
    if not formats:
        return Finding(str(node), GOOD, "no images; another device of the same camera delivers them")
    return Finding(str(node), GOOD, f"delivers {', '.join(formats)}")


def _pixel_formats(node: Path) -> list[str]:
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
