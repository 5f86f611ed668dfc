"""The checks of vm-doctor: each returns a finding about the machine or the configuration, and a command as the fix."""

from __future__ import annotations

import asyncio
import math
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from ..borders.sockets import is_listening
from ..cameras.camera import Shot
from ..cameras.open_camera import brings_lens_and_pose, is_live
from ..cameras.ros.bags import is_bag
from ..errors import InputError, VisualMeshError, one_line
from ..geometry.lens_doubt import lens_doubt
from ..geometry.orientation import Orientation
from ..live.configuration import Configuration
from ..live.control import control_path
from ..live.load_detector import check_height, prove_network
from ..network.model_file import ModelFile
from .camera_checks import check_cameras
from .camera_source import SourceFacts, check_pose_source, check_source, samples_of
from .finding import BAD, GOOD, WARNING, Finding
from .frame_trial import check_detection
from .machine_checks import check_clock, check_governor, check_opencv, check_processor, check_threads
from .openings import check_openings

_HIGHEST = 20.0
"""Height of a camera from which the pose is probably in other units [m]."""


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
        raw = configuration.detector.format != "bgr"
        shots: list[Shot] = []
        yield from check_cameras(configuration.camera, raw, fault, _is_running(configuration), root / "dev", shots)
        yield check_lens(configuration, source)
        yield check_pose(configuration, source, model)
        if model is not None and not fault:
            yield from _check_frames(configuration, model, shots)
        yield check_clock(root / "sys/devices/system/clocksource/clocksource0/current_clocksource", time.time())
        yield from check_openings(configuration)
    except OSError as error:
        yield Finding("machine", WARNING, one_line(error))


def _is_running(configuration: Configuration) -> bool:
    """Whether a detector with this configuration runs."""
    with suppress(InputError):
        return is_listening(control_path(configuration.status.socket))
    return False


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


def _check_frames(configuration: Configuration, model: ModelFile, shots: list[Shot]) -> Iterator[Finding]:
    """What the detector sees in the user's frames; nothing if a camera gave none, or has no lens or pose."""
    try:
        samples = samples_of(configuration, shots)
    except VisualMeshError as error:
        yield Finding("detection", WARNING, str(error), "see camera, lens and pose")
        return
    if samples:
        yield check_detection(model, configuration.detector, samples)


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
