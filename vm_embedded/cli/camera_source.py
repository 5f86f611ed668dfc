"""Whether the configured camera and its poses can work, as far as a program can tell before it runs."""

from __future__ import annotations

from dataclasses import dataclass

from ..cameras.image_files import lens_beside, open_source
from ..cameras.open_camera import ROS, camera_opener, is_live
from ..cameras.ros.bags import is_bag
from ..geometry.lens import Size
from ..geometry.lens_files import LensFile, read_lens_file
from ..live.configuration import Configuration
from ..poses.settings import check_without_ros


@dataclass(frozen=True)
class SourceFacts:
    """What is known about the images of a camera before it runs.

    size: width and height [px]: of the first image of files, else as configured; None if unknown. lens_file: the file
    beside the first image, which takes precedence over the configured lens and pose; None if there is none.
    """

    size: Size | None = None
    lens_file: LensFile | None = None


def check_source(configuration: Configuration) -> SourceFacts:
    """What is known about the images of the configured camera. A live camera is not opened.

    Raises InputError for a source or setting that can never work, for files without a readable image, and for a
    damaged lens file beside the first one.
    """
    camera, raw = configuration.camera, configuration.detector.format != "bgr"
    if camera.source and not is_live(camera.source) and not is_bag(camera.source):
        frame = next(open_source(camera.source, raw, camera.max_megapixels).frames)
        image, beside = frame.read(), lens_beside(frame.path)
        return SourceFacts((image.shape[1], image.shape[0]), None if beside is None else read_lens_file(beside))
    if camera.source not in ("", ROS):  # vm-ros opens a topic itself
        camera_opener(camera, raw)
    return SourceFacts((camera.width, camera.height) if camera.width and camera.height else None)


def check_pose_source(configuration: Configuration) -> None:
    """Raise InputError for poses that vm-detect can't get. A camera of ROS, or none, is for vm-ros."""
    camera = configuration.camera.source
    if camera not in ("", ROS) and not is_bag(camera):
        check_without_ros(configuration.pose.source)
