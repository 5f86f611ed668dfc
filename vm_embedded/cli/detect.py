"""vm-detect: detect in files or on a live camera, or ask a running detector."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import cv2

from ..borders.credentials import without_password
from ..cameras.library_messages import silence_opencv
from ..cameras.open_camera import is_live
from ..cameras.ros.bags import is_bag
from ..config.toml_reader import parse_toml
from ..config.toml_writer import to_commented_toml
from ..errors import InputError
from ..files import read_text
from ..live.configuration import HEADER
from ..live.control import REFUSED, ask, control_path
from ..live.daemon import Daemon
from ..live.log import EventLog
from ..network.bundled import SHIPPED, shipped_name
from .check_configuration import check_configuration
from .detect_files import detect_in_files
from .options import ANGLES, LIVE, add_live, add_model, add_pose, add_settings, add_track, read_options
from .program import EXIT_FAILED, EXIT_OK, Parser, complain, program, run_or_complain
from .run_daemon import report_failed_start, run_daemon

_FILES_ONLY = (
    "save_mcap",
    "save_boxes",
    "save_overlay",
    "save_map",
    "save_video",
    "save_points",
    "emit_points",
    "explain",
)
"""Options that a live camera rejects."""

_LIVE_ONLY = ("output", "status", "recorder")
"""Sections of vm.toml whose options only a live camera has; [pose] also counts for bags."""


def parser() -> argparse.ArgumentParser:
    """The command line of vm-detect; its settings are the fields of Settings."""
    parser = Parser(
        prog="vm-detect",
        description="Find objects in images, videos or live cameras, and print a line for each frame: for people at a "
        "terminal, otherwise JSON.",
        epilog="Exit status for files: 0, at least one frame was processed; 1, no frame was processed. For a live "
        "camera: 0, a signal such as Ctrl-C stopped it, or the played file has ended; 1, a second signal ended it at "
        "once, or the played file has ended and no frame could be processed; 75, reads of the camera or a frame "
        "hang, or the network lacks an address of the configuration, and a restart may help; 78, the configuration "
        "can't be used, and a restart would fail again. "
        "For --status: 0, the state is ok; 1, the state is not ok, or nothing answers. Always: 2, the options can't be "
        "parsed; 130, Ctrl-C while files are processed, or before the live camera runs. " + ANGLES,
    )
    parser.add_argument(
        "files",
        nargs="*",
        metavar="FILE",
        help="the same as --camera: images, folders, videos or bags; several are processed one after the other",
    )
    parser.add_argument(
        "--camera",
        metavar="SOURCE",
        help="files, each frame once: an image, a folder or glob of images, a video, or a bag of ROS 2; or a live "
        "camera: its number or device, an http, https or rtsp address, gstreamer:PIPELINE, or synthetic",
    )
    parser.add_argument(
        "--live", action="store_true", help="play files like a live camera: at their frame rate, skipping late frames"
    )
    parser.add_argument(
        "--json",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="print each frame as a line of JSON, or as a line for people; default: for people if standard output is "
        "a terminal",
    )
    add_model(parser)
    add_pose(parser, "for frames imageNAME.* without a file lensNAME.yaml beside them")
    daemon = parser.add_argument_group("a running detector, and its configuration")
    daemon.add_argument(
        "--status",
        dest="ask",
        action="store_const",
        const="status",
        help="print the status of the running detector, and exit",
    )
    daemon.add_argument(
        "--record",
        dest="ask",
        action="store_const",
        const="record",
        help="make the running detector record its last seconds, and exit",
    )
    daemon.add_argument("--check-config", action="store_true", help="check the configuration and the model, and exit")
    daemon.add_argument("--print-config", action="store_true", help="print a vm.toml with every entry, and exit")
    output = parser.add_argument_group("output, for files")
    output.add_argument(
        "--save-overlay", type=Path, metavar="DIR", help="write each image as NAME.jpg with its detections drawn in"
    )
    overhead = output.add_argument(
        "--save-map", type=Path, metavar="DIR", help="write NAME-map.png: what each image shows, from above"
    )
    output.add_argument(
        "--save-video",
        type=Path,
        metavar="FILE",
        help="write all frames, with their detections drawn in, as one .mp4, .avi or .webm, at the rate of the video "
        "that is read, or 10 a second for images",
    )
    points = output.add_argument(
        "--save-points", type=Path, metavar="DIR", help="write NAME.npz with pixels, rays and probabilities"
    )
    output.add_argument(
        "--save-boxes",
        type=Path,
        metavar="DIR",
        help="write each image, its lens and pose, and the boxes of its objects as NAME.txt in YOLO format, for "
        "annotation tools and vm-label; near misses go to candidates.jsonl; DIR must be new or empty",
    )
    output.add_argument(
        "--save-mcap",
        type=Path,
        metavar="FILE",
        help="write images, lenses, poses, detections and states as FILE.mcap, for Foxglove and ROS 2",
    )
    emit = output.add_argument("--emit-points", metavar="CLASS,...", help="add the points of these classes to the JSON")
    output.add_argument("--explain", action="store_true", help="add rejected proposals or clusters, with reasons")
    for rare in (overhead, points, emit):
        parser.hide(rare)
    add_settings(parser)
    add_track(parser)
    add_live(parser)
    return parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-detect and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    end = given.index("--") if "--" in given else len(given)  # argparse rejects it among intermixed arguments
    options = parser().parse_intermixed_args(given[:end])
    # A shell turns `--camera *.jpg` into the first file and further ones.
    first = [] if options.camera is None else [options.camera]
    options.files = [*first, *options.files, *given[end + 1 :]]
    options.camera = options.files[0] if options.files else None
    silence_opencv()
    cv2.setNumThreads(1)  # a frame has a few thousand points: too little work for more
    if options.json is None:
        options.json = not sys.stdout.isatty() or bool(options.emit_points)
    return run_or_complain("vm-detect", lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    """Do what the options ask for: print or check the configuration, ask a running detector, or detect."""
    if options.ask:
        return _ask(_status_socket(options), options.ask)
    try:
        given = read_options(options)
    except InputError as error:
        if options.print_config or options.check_config or not _is_for_live(options):
            raise
        return report_failed_start(EventLog(), error)
    if options.print_config:
        print(to_commented_toml(replace(given, model=_movable(given.model)), HEADER), end="")
        return EXIT_OK
    if options.check_config:
        print(check_configuration(given, with_ros=False))
        return EXIT_OK
    if not given.camera.source:
        parser().error("no camera: give a file or --camera, or [camera] source in vm.toml")
    if len(options.files) > 1 and options.live and not any(map(is_live, options.files)):
        raise InputError(
            f"--live plays one video, folder or pattern, not {len(options.files)} files; put a pattern in quotes, so "
            "that the shell does not replace it: --camera 'frames/*.jpg' --live"
        )
    if len(options.files) > 1 and any(map(is_live, options.files)):
        raise InputError(
            f"only one live camera at a time is possible, not {', '.join(map(without_password, options.files))}"
        )
    if options.live or is_live(given.camera.source):
        return _detect_live(options)
    _check_file_options(options)
    return EXIT_OK if detect_in_files(options, given) else EXIT_FAILED


def _is_for_live(options: argparse.Namespace) -> bool:
    """Whether the options ask for a live camera, as far as they tell without vm.toml, which usually names one."""
    return options.live or (is_live(options.camera) if options.camera else options.config is not None)


def _movable(model: str) -> str:
    """A model as a vm.toml in any folder may name it: by its name in the package, else by its absolute path."""
    return model if model in SHIPPED else shipped_name(Path(model)) or str(Path(model).absolute())


def _status_socket(options: argparse.Namespace) -> str:
    """[status] socket of the configuration, also of one with errors elsewhere."""
    try:
        return read_options(options).status.socket
    except InputError as error:  # the detector runs with what it has read before
        complain("vm-detect", str(error))
        return options.status_socket or _socket_in(options.config)


def _socket_in(config: Path | None) -> str:
    """[status] socket of a vm.toml that has errors elsewhere; empty if it can't be read."""
    try:
        socket = parse_toml(read_text(config or Path()))["status"]["socket"]
    except (ValueError, InputError, KeyError, TypeError):
        return ""
    return socket if isinstance(socket, str) else ""


def _ask(socket: str, command: str) -> int:
    """Send a command to the running detector and print its reply. Fails unless the detector is in state ok."""
    reply = ask(control_path(socket), command)
    if reply.startswith(REFUSED):
        raise InputError(reply.removeprefix(REFUSED))
    try:
        good = command != "status" or json.loads(reply)["state"] == "ok"
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"unexpected reply; is this vm-detect? {reply[:60]!r}") from error
    print(reply)
    return EXIT_OK if good else EXIT_FAILED


def _check_file_options(options: argparse.Namespace) -> None:
    """Raise InputError for options that files reject."""
    if options.emit_points and not options.json:
        raise InputError("--emit-points adds the points to the JSON: leave --no-json out")
    sections = _LIVE_ONLY if any(map(is_bag, options.files)) else (*_LIVE_ONLY, "pose")
    for name in (f"{section}_{each.name}" for section in sections for each in fields(LIVE[section])):
        if getattr(options, name, None) is not None:
            raise InputError(
                f"--{name.replace('_', '-')} works only with a live camera; --live plays files like a live camera"
            )


def _detect_live(options: argparse.Namespace) -> int:
    """Run the daemon on a live camera until it is stopped."""
    log = EventLog()
    try:
        _check_live_options(options)
    except InputError as error:
        return report_failed_start(log, error)
    return run_daemon(log, lambda: Daemon.prepare(lambda: read_options(options), log, readable=not options.json))


def _check_live_options(options: argparse.Namespace) -> None:
    """Raise InputError for options that a live camera rejects."""
    for name in _FILES_ONLY:
        if getattr(options, name):
            raise InputError(
                f"--{name.replace('_', '-')} works only with files, not with a live camera; make a recording, and "
                "give its folder"
            )
    if any(map(is_bag, options.files)):
        raise InputError("a bag can't be played with --live; give it without --live, or play it for vm-ros")


if __name__ == "__main__":
    sys.exit(main())
