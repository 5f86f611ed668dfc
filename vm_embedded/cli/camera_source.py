"""Whether the configured camera and its poses can work, as far as a program can tell before it runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

from ..cameras.camera import Shot
from ..cameras.image_files import lens_beside, open_source
from ..cameras.open_camera import ROS, camera_opener, is_live
from ..cameras.ros.bags import is_bag
from ..geometry.lens import Size
from ..geometry.lens_files import LensFile, read_lens_file
from ..live.configuration import Configuration
from ..poses.settings import check_without_ros
from .default_pose import DefaultPose
from .detect_files import open_frames
from .frame_trial import Sample

_FRAMES = 5
"""Frames of files to search."""


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


def samples_of(configuration: Configuration, shots: Iterable[Shot]) -> list[Sample]:
    """The first frames of files, or the shots that a live camera has delivered, with their lenses and fixed poses.

    Of a live camera, there are none without a lens or a fixed pose, whose own checks tell that. Raises InputError for
    files with a damaged frame, or without lens or pose.
    """
    camera = configuration.camera
    if camera.source and not is_live(camera.source):
        return list(_file_samples(configuration))
    orientation = configuration.fixed_orientation() if configuration.pose.source == "fixed" else None
    samples = []
    for number, shot in enumerate(shots, start=1):
        lens = shot.lens or configuration.lens_for((shot.image.shape[1], shot.image.shape[0]))
        pose = shot.orientation or orientation
        if lens is not None and pose is not None:
            samples.append(Sample(f"frame {number}", shot.image, lens, pose, pose is orientation))
    return samples


def _file_samples(configuration: Configuration) -> Iterator[Sample]:
    default = DefaultPose(configuration, configuration.fixed_orientation())
    for frame in islice(open_frames([configuration.camera.source], configuration).frames, _FRAMES):
        image = frame.read()
        lens, orientation = default.of(frame, (image.shape[1], image.shape[0]))
        yield Sample(frame.source, image, lens, orientation, orientation is default.orientation)
