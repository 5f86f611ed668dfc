"""vm-ros: run the detector as a node of ROS 2."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import Any

import cv2

from vm_embedded.cameras.library_messages import silence_opencv
from vm_embedded.cameras.open_camera import ROS
from vm_embedded.cameras.ros.settings import NODE
from vm_embedded.cli.check_configuration import check_configuration
from vm_embedded.cli.options import ANGLES, add_live, add_model, add_pose, add_settings, add_track, read_options
from vm_embedded.cli.program import EXIT_FAILED, EXIT_OK, Parser, program
from vm_embedded.cli.run_daemon import run_daemon
from vm_embedded.errors import InputError, VisualMeshError, install_extra
from vm_embedded.live.configuration import Configuration, with_overrides
from vm_embedded.live.daemon import Daemon
from vm_embedded.live.log import EventLog

from .middleware import Middleware
from .node import Node

ROS_ARGUMENTS = "--ros-args"
"""Everything behind this option is for ROS."""

_TOPIC = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


def parser() -> argparse.ArgumentParser:
    """The command line of vm-ros; its settings are those of a live camera of vm-detect."""
    parser = Parser(
        prog="vm-ros",
        description="Run the detector as a node of ROS 2: publish what the images of a topic show as vision_msgs and "
        "soccer_vision messages, and the state as diagnostics. Lines on standard output need --output-stdout. It uses "
        "rclpy where ROS is sourced, and the package cyclonedds elsewhere.",
        epilog="Exit status: as that of vm-detect for a live camera. Where ROS is sourced, the options behind "
        f"{ROS_ARGUMENTS} are those of ROS, such as -r for remapping. " + ANGLES,
    )
    parser.add_argument(
        "--camera",
        metavar="SOURCE",
        help=f"{ROS}: the images of the topic --ros-image; or another live camera, as for vm-detect; default {ROS}",
    )
    parser.add_argument("--check-config", action="store_true", help="check the configuration and the model, and exit")
    add_model(parser)
    add_pose(parser, "instead of camera_info and tf")
    add_settings(parser)
    add_track(parser)
    add_live(parser)
    return parser


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run vm-ros and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    cut = given.index(ROS_ARGUMENTS) if ROS_ARGUMENTS in given else len(given)
    options = parser().parse_args(given[:cut])
    silence_opencv()
    cv2.setNumThreads(1)
    if options.check_config:
        return _check(options)
    log = EventLog()
    return run_daemon(log, lambda: _prepare(given[:cut], given[cut + 1 :], options, log))


def _check(options: argparse.Namespace) -> int:
    """Check the configuration without connecting to ROS, and return the exit status."""
    try:
        print(check_configuration(configuration(options), with_ros=True))
    except VisualMeshError as error:
        print(f"vm-ros: {error}", file=sys.stderr)
        return EXIT_FAILED
    return EXIT_OK


async def _prepare(
    words: Sequence[str], ros_arguments: Sequence[str], options: argparse.Namespace, log: EventLog
) -> Daemon:
    """Connect to ROS, and prepare a daemon that publishes there. options: of `words`. Raises VisualMeshError."""
    middleware = connect(NODE, ros_arguments, configuration(options).ros.middleware)
    if middleware.remark:
        log("ros", "warning", remark=middleware.remark)
    options = parser().parse_args([*parameter_options(middleware.parameters), *words])
    node = Node(configuration(options), middleware)
    return await Daemon.prepare(lambda: configuration(options), log, node)


def parameter_options(parameters: Mapping[str, Any]) -> list[str]:
    """The options that parameters of the node stand for: height for --height, ros_image for --ros-image."""
    words = []
    for name, value in parameters.items():
        option = name.replace("_", "-")
        words.append(
            f"--{option}={value}" if not isinstance(value, bool) else f"--{option if value else f'no-{option}'}"
        )
    return words


def configuration(options: argparse.Namespace) -> Configuration:
    """The configuration of vm-detect, with images of ROS, and poses of tf unless a pose is given. Raises InputError.

    Only the option --output-stdout turns standard output on: a vm.toml of --print-config always names it.
    """
    given = read_options(options)
    ros: dict[str, dict[str, Any]] = {"output": {"stdout": bool(options.output_stdout)}}
    if not given.camera.source:
        ros["camera"] = {"source": ROS}
    if (given.camera.source or ROS) == ROS and given.pose.source == "fixed" and given.fixed_orientation() is None:
        ros["pose"] = {"source": "tf"}
    _check_topics(given)
    return with_overrides(given, ros)


def _check_topics(given: Configuration) -> None:
    """Raise InputError for a name that no topic of ROS can have."""
    kind, _, pose = given.pose.source.partition(":")
    topics = {
        "--ros-image": given.ros.image,
        "--ros-camera-info": given.ros.camera_info,
        "--ros-namespace": given.ros.namespace.rstrip("/"),
        "--pose-source topic:": pose if kind == "topic" else "",
    }
    for option, topic in topics.items():
        if topic and not _TOPIC.fullmatch(topic):
            raise InputError(
                f"{option} must be a name of letters, digits, _ and /, as in /camera/image_raw, not {topic!r}"
            )


def connect(name: str, ros_arguments: Sequence[str] = (), kind: str = "auto") -> Middleware:
    """Connect a node with a name.

    ros_arguments: those behind --ros-args, only for rclpy. kind: rclpy, cyclonedds, or auto: rclpy where ROS is
    sourced, otherwise cyclonedds. Raises InputError if the one needed is not installed.
    """
    if kind == "auto":  # rclpy from wheels comes without tf2_msgs and vision_msgs
        sourced = find_spec("tf2_msgs") or ros_arguments or not find_spec("cyclonedds")
        kind = "rclpy" if sourced and find_spec("rclpy") else "cyclonedds"
    try:
        if kind == "rclpy":
            from .rclpy_middleware import RclpyMiddleware

            return RclpyMiddleware(name, ros_arguments)
        from .dds_middleware import DdsMiddleware
    except ImportError as error:
        raise InputError(
            f"vm-ros needs ROS 2 (source its setup.bash) or the package cyclonedds ({error}); {install_extra('ros')}"
        ) from error
    if ros_arguments:
        raise InputError("--ros-args works only with rclpy: source ROS 2, or give the options of vm-ros instead")
    return DdsMiddleware()


if __name__ == "__main__":
    sys.exit(main())
