"""vm-detect: from frames to JSON lines."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from ..cameras.image_files import Frame, check_file_format, lens_beside, open_source
from ..cameras.open_camera import is_live
from ..config.toml_writer import to_commented_toml
from ..detection.detector import Detector
from ..errors import InputError, VisualMeshError
from ..geometry.lens import Lens
from ..geometry.lens_files import read_lens_file
from ..geometry.orientation import Orientation
from ..live.configuration import Configuration
from ..live.control import REFUSED, ask, default_socket_path
from ..live.daemon import EXIT_CONFIGURATION, Daemon
from ..live.load_detector import load_checked_detector
from ..live.log import EventLog
from ..output.messages import file_message
from ..output.result_files import make_folder, save_overlay, save_points
from .options import ANGLES, add_live, add_model, add_pose, add_settings, read_options
from .progress import ProgressBar

EXIT_OK, EXIT_FAILED, EXIT_USAGE, EXIT_INTERRUPTED = 0, 1, 2, 130


def parser() -> argparse.ArgumentParser:
    """The command line of vm-detect; its settings are the fields of Settings."""
    parser = argparse.ArgumentParser(
        prog="vm-detect",
        description="Find objects in frames: one line of JSON for each frame on standard output.",
        epilog="Exit status: 0 at least one frame was processed (bad ones are named on standard error), or a live "
        "camera was stopped; 1 none was, or a detector that was asked is not well; 2 wrong usage; 75 reads of the "
        "camera hang, 78 the configuration of a live one can't be used; 130 interrupted. " + ANGLES,
    )
    parser.add_argument(
        "--camera",
        metavar="SOURCE",
        help="an image, a directory or quoted glob of images, or a video file: each frame once; or what is live: a "
        "camera's number or device, an http, https or rtsp address, gstreamer:PIPELINE, synthetic, or fault:SCRIPT",
    )
    parser.add_argument(
        "--live", action="store_true", help="play files at their rate, as if a camera gave them, and skip what is late"
    )
    add_model(parser)
    add_pose(parser, "for frames imageNAME.* without a lensNAME.yaml beside them, which goes first")
    daemon = parser.add_argument_group("a running detector, and its configuration")
    daemon.add_argument("--status", dest="ask", action="store_const", const="status", help="print how it is, and exit")
    daemon.add_argument(
        "--record", dest="ask", action="store_const", const="record", help="have it write down its last seconds"
    )
    daemon.add_argument("--check-config", action="store_true", help="read the configuration and the model, and exit")
    daemon.add_argument("--print-config", action="store_true", help="print a vm.toml with every entry, and exit")
    output = parser.add_argument_group("output, for files")
    output.add_argument("--save-overlay", type=Path, metavar="DIR", help="write pictures with what was found")
    output.add_argument("--save-points", type=Path, metavar="DIR", help="write NAME.npz: pixels, rays, probabilities")
    output.add_argument("--emit-points", metavar="CLASS,...", help="list the points of these classes in the JSON")
    output.add_argument("--explain", action="store_true", help="list rejected clusters in the JSON, with reasons")
    add_settings(parser)
    add_live(parser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-detect and return its exit status."""
    options = parser().parse_args(arguments)
    # What is wrong with a file or camera is said here, in one line; OpenCV and FFmpeg would add theirs.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    cv2.setNumThreads(1)  # a few thousand pixels of a frame are no work for all cores
    try:
        return _run(options)
    except VisualMeshError as error:
        _complain(str(error))
        return EXIT_FAILED
    except BrokenPipeError:
        # Whoever read the lines has seen enough; keep the interpreter from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except OSError as error:  # a full disk behind standard output, say
        _complain(f"can't write results: {error.strerror or error}")
        return EXIT_FAILED
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


@dataclass(frozen=True)
class _Pose:
    """Lens and orientation for frames that bring none; None where the user gave none."""

    lens: Lens | None
    orientation: Orientation | None

    def of(self, frame: Frame) -> tuple[Lens, Orientation]:
        """Lens and orientation of a frame. Raises InputError saying what is missing."""
        lens, orientation = self.lens, self.orientation
        beside = lens_beside(frame.path)
        if beside is not None:
            file = read_lens_file(beside)
            lens, orientation = file.lens, file.orientation or orientation
        if lens is None:
            raise InputError("no lens: give --lens, or put lensNAME.yaml beside imageNAME")
        if orientation is None:
            raise InputError("no orientation: give --height (and --pitch, --roll), or Hoc in lensNAME.yaml")
        return lens, orientation


def _run(options: argparse.Namespace) -> int:
    asked = options.print_config or options.ask or options.check_config
    live = options.live or (is_live(options.camera) if options.camera else options.config is not None)
    try:
        given = read_options(options)
    except InputError as error:
        if asked or not live:
            raise
        return _refuse(error)
    if options.print_config:
        print(to_commented_toml(given), end="")
        return EXIT_OK
    if options.ask:
        return _ask(given, options.ask)
    if options.check_config:
        return _check(given)
    if not given.camera.source:
        parser().error("no camera: give --camera, or [camera] source in vm.toml")
    if options.live or is_live(given.camera.source):
        return _watch(options)
    return _look(options, given)


def _ask(given: Configuration, word: str) -> int:
    """Print the answer of a running detector. Fails if it is not well."""
    answer = ask(Path(given.status.socket) if given.status.socket else default_socket_path(), word)
    if answer.startswith(REFUSED):
        raise InputError(answer.removeprefix(REFUSED))
    try:
        well = word != "status" or json.loads(answer)["state"] == "ok"
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"what answers there is no detector: {answer[:60]!r}") from error
    print(answer)
    return EXIT_OK if well else EXIT_FAILED


def _check(given: Configuration) -> int:
    """Say whether a detector would run with what is configured."""
    detector = load_checked_detector(given)
    print(f"{given.model}: {len(detector.manifest.classes)} classes, self-test passed; the configuration is good")
    return EXIT_OK


def _watch(options: argparse.Namespace) -> int:
    """Run as a daemon on a live camera."""
    for number in (signal.SIGHUP, signal.SIGUSR1):
        signal.signal(number, signal.SIG_IGN)  # until there is something to read again, and to record
    try:
        for name in ("save_overlay", "save_points", "emit_points", "explain"):
            if getattr(options, name):
                raise InputError(f"--{name.replace('_', '-')} is for files, each frame of which is looked at")
        daemon = Daemon(lambda: read_options(options), EventLog("vm-detect"))
        return asyncio.run(daemon.run())
    except VisualMeshError as error:
        return _refuse(error)


def _refuse(error: VisualMeshError) -> int:
    """Log why a daemon can't run; its status says that another start would be in vain."""
    EventLog("vm-detect")("can't start", "error", reason=str(error))
    return EXIT_CONFIGURATION


def _look(options: argparse.Namespace, given: Configuration) -> int:
    """Process each frame of a file or folder once."""
    settings = given.detector
    pose = _Pose(given.lens.lens if given.lens else None, given.orientation.orientation())
    detector = Detector.from_file(given.model, settings)
    emit = [name.strip() for name in options.emit_points.split(",")] if options.emit_points else []
    for name in emit:
        detector.manifest.column(name)
    check_file_format(settings.format)
    source = open_source(given.camera.source, raw=settings.format != "bgr")
    for folder in (options.save_overlay, options.save_points):
        if folder is not None:
            make_folder(folder)

    processed = 0
    progress = ProgressBar(source.count)
    for frame in source.frames:
        try:
            line = _process(frame, detector, pose, options, emit)
        except VisualMeshError as error:
            progress.clear()
            _complain(f"{frame.source}: {error}")
            continue
        progress.clear()
        print(line, flush=True)
        processed += 1
        progress.show(frame.index + 1)
    progress.clear()
    return EXIT_OK if processed else EXIT_FAILED


def _process(frame: Frame, detector: Detector, pose: _Pose, options: argparse.Namespace, emit: Sequence[str]) -> str:
    image = frame.read()
    lens, orientation = pose.of(frame)
    detections = detector.detect(image, orientation, lens, explain=options.explain)
    if options.save_points is not None:
        save_points(options.save_points, frame, detections)
    if options.save_overlay is not None:
        save_overlay(options.save_overlay, frame, image, detections)
    return json.dumps(file_message(frame, detections, emit, options.explain), allow_nan=False)


def _complain(message: str) -> None:
    print(f"vm-detect: {' '.join(message.split())}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
