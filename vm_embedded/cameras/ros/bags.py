"""Read the frames of a bag of ROS 2 (.mcap or .db3), each with its lens and pose.

The lens comes from camera_info. The pose comes from tf, interpolated at the stamp of the image, or from a topic of
geometry_msgs/PoseStamped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...arrays import Image
from ...errors import InputError, VisualMeshError, one_line, unknown
from ...files import is_file, open_regular, there
from ...geometry.lens import Lens
from ...geometry.orientation import Orientation
from ...poses.buffer import PoseBuffer, StalePoseError
from ...poses.settings import PoseSettings
from ..frame_source import IMAGE_SUFFIXES, Frame, Source
from ..image_files import natural_key
from ..image_header import MAX_MEGAPIXELS
from .bag_types import damage_errors, import_rosbags, typestore
from .camera_poses import newest_pose, orientation_of
from .images import image_of
from .lens import lens_of, rectified_doubt
from .message_fields import MESSAGES
from .settings import DRAWN, RosSettings, camera_info_beside
from .stamps import seconds_of
from .transforms import Transform, TransformTree
from .unfinished import UnfinishedMcap, is_finished

SUFFIXES = (".mcap", ".db3")
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")

_METADATA = "metadata.yaml"
"""The file that a recorder writes at its end."""

_AHEAD = 1.0
"""How long after an image its pose may be in the bag [s]."""


def is_bag(name: str) -> bool:
    """Whether a source is a bag: a file, or the folder that `ros2 bag record` makes.

    A recorder that is killed leaves no metadata.yaml in the folder.
    """
    path = there(Path(name))
    return path.suffix.lower() in SUFFIXES or is_file(path / _METADATA) or bool(_files_of(path))


def _files_of(folder: Path) -> list[Path]:
    """The files of a bag in a folder without images, in the order of their numbers; none if it is no folder."""
    try:
        inside = sorted(folder.iterdir(), key=natural_key)
    except OSError:
        return []
    if any(each.suffix.lower() in IMAGE_SUFFIXES for each in inside):
        return []
    return [each for each in inside if each.suffix.lower() in SUFFIXES and is_file(each)]


@dataclass(frozen=True, kw_only=True)
class BagReading:
    """How to read a bag.

    ros: its topics and frames. pose: from where poses come, and how old they may be. own_lens: of the caller; then
    the frames get none. orientation: used for all images instead of those in the bag. raw: images keep their own
    channels. max_megapixels: largest image [Mpx].
    """

    ros: RosSettings = field(default_factory=RosSettings)
    pose: PoseSettings = field(default_factory=PoseSettings)
    own_lens: Lens | None = None
    orientation: Orientation | None = None
    raw: bool = False
    max_megapixels: float = MAX_MEGAPIXELS


def open_bag(name: str, reading: BagReading) -> Source:
    """The frames of a bag. Raises InputError if it can't be read, or if it is not clear which topic to take."""
    rosbags = import_rosbags()
    path = there(Path(name))
    try:
        if not path.exists():
            raise InputError(f"no such bag: {name}")
        files = tuple(sorted(each for each in path.iterdir() if not each.is_dir())) if path.is_dir() else (path,)
        for each in files:
            open_regular(each).close()  # rosbags waits for the writer of a pipe
        paths, remarks = _parts(path)
        reader = rosbags.highlevel.AnyReader(paths, default_typestore=typestore())
        reader.open()
    except damage_errors() as error:
        place, reason = getattr(error, "filename", None) or name, getattr(error, "strerror", None) or one_line(error)
        raise InputError(f"can't read bag {place}: {reason}") from error
    try:
        images = _image_topic(name, reader, reading.ros)
        info = reading.ros.camera_info or camera_info_beside(images)
        _check_topics(name, reader, reading, info)
    except InputError as error:
        reader.close()
        raise InputError("; ".join([str(error), *remarks])) from error
    count = reader.topics[images].msgcount
    rate = (count - 1) / (1e-9 * reader.duration) if count > 1 and reader.duration > 0 else None
    settings = replace(reading, ros=replace(reading.ros, image=images, camera_info=info))
    frames = _BagFrames(path.name, reader, settings)
    return Source(frames.frames(), count, rate, files, lambda: [*remarks, *frames.remarks()])


def _parts(path: Path) -> tuple[list[Any], list[str]]:
    """What rosbags is to read of a bag, and remarks about what its recorder did not finish. Raises InputError, OSError.

    An unfinished file is read up to its last whole record.
    """
    metadata = path / _METADATA
    has_metadata = is_file(metadata) and metadata.stat().st_size > 0
    files = _files_of(path) if path.is_dir() else [path]
    if all(map(is_finished, files)):
        if has_metadata or not path.is_dir():
            return [path], []
        return list(files), [f"the recording {path.name} was not finished: it has no {_METADATA}"]
    parts: list[Any] = [each if is_finished(each) else UnfinishedMcap(each) for each in files if each.stat().st_size]
    if not parts:
        raise InputError(f"bag {path} is empty: its recorder was ended too early")
    lost = sum(each.lost for each in parts if isinstance(each, UnfinishedMcap))
    cut = f"; {lost} bytes at its end can't be read" if lost else ""
    return parts, [f"the recording {path.name} was not finished{cut}"]


def _image_topic(name: str, reader: Any, ros: RosSettings) -> str:
    """The topic of the images that no vm-ros has drawn. Raises InputError for one that the bag lacks, or if there are
    several."""
    drawn, chosen = [f"{ros.namespace.rstrip('/')}/{each}" for each in DRAWN], ros.image
    topics = sorted(
        topic
        for topic, info in reader.topics.items()
        if info.msgtype in _IMAGES and info.msgcount and topic not in drawn
    )
    if not topics:
        raise InputError(f"bag {name} has no images (its topics: {', '.join(sorted(reader.topics)) or 'none'})")
    if chosen and chosen not in topics:
        raise InputError(f"bag {name}: {unknown('topic of images', chosen, topics)}")
    if not chosen and len(topics) > 1:
        raise InputError(f"bag {name} has several topics of images; choose one: --ros-image {' or '.join(topics)}")
    return chosen or topics[0]


def _check_topics(name: str, reader: Any, reading: BagReading, info: str) -> None:
    """Raise InputError if a chosen topic is not in the bag, or if a topic has another type of messages."""
    pose = reading.pose.source.removeprefix("topic:") if reading.pose.source.startswith("topic:") else ""
    for topic in filter(None, (reading.ros.camera_info, pose)):
        if topic not in reader.topics:
            raise InputError(f"bag {name}: {unknown('topic', topic, sorted(reader.topics))}")
    needed = [(info, "CameraInfo"), ("/tf", "TFMessage"), ("/tf_static", "TFMessage"), (pose, "PoseStamped")]
    for topic, message in needed:
        found = reader.topics[topic].msgtype if topic in reader.topics else MESSAGES[message]
        if found != MESSAGES[message]:
            raise InputError(f"bag {name}: topic {topic} must have messages of type {MESSAGES[message]}, not {found}")


@dataclass(frozen=True, eq=False)
class _Waiting:
    """An image that waits for its pose. stamp [s]: of its header. logged [s]: when it was recorded."""

    message: Any
    stamp: float
    logged: float


class _BagFrames:
    """Reads a bag once, and keeps images back until their pose is known."""

    def __init__(self, name: str, reader: Any, reading: BagReading) -> None:
        self._name, self._reader, self._reading = name, reader, reading
        source = reading.pose.source
        self._pose_topics = (source.removeprefix("topic:"),) if source.startswith("topic:") else ("/tf", "/tf_static")
        self._tree, self._poses = TransformTree(), PoseBuffer(reading.pose)
        self._lens: Lens | None = None
        self._lens_trouble = (
            "" if reading.own_lens is not None else f"no message on {reading.ros.camera_info}; give --lens or --fov"
        )
        self._pose_trouble = ""
        self._count = 0

    def frames(self) -> Iterator[Frame]:
        """The frames in the order of the bag."""
        ros, waiting = self._reading.ros, deque[_Waiting]()
        topics = {ros.image, ros.camera_info, *self._pose_topics}
        connections = [each for each in self._reader.connections if each.topic in topics]
        try:
            for connection, logged, data in self._messages(connections):
                now, message = 1e-9 * logged, self._reader.deserialize(data, connection.msgtype)
                if connection.topic == ros.image:
                    waiting.append(_Waiting(message, seconds_of(message.header.stamp), now))
                elif connection.topic == ros.camera_info:
                    self._take_lens(message)
                else:
                    self._take_pose(message, connection.topic)
                while waiting and (now > waiting[0].logged + _AHEAD or self._has_pose(waiting[0])):
                    yield self._frame(waiting.popleft())
            while waiting:
                self._has_pose(waiting[0])
                yield self._frame(waiting.popleft())
        except damage_errors() as error:
            raise InputError(f"bag {self._name} is damaged: {one_line(error)}") from error
        finally:
            self._reader.close()

    def _messages(self, connections: Sequence[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """The messages in the order of their times; those of unfinished files, which have no index, as they come."""
        readers = self._reader.readers
        if not any(isinstance(each.path, UnfinishedMcap) for each in readers):
            yield from self._reader.messages(connections)
            return
        for reader in readers:
            own = [each for each in connections if each.owner is reader.storage]
            scan = isinstance(reader.path, UnfinishedMcap)
            yield from reader.storage.messages_scan(own) if scan else reader.messages(own)

    def remarks(self) -> list[str]:
        """What is strange about the frames so far."""
        lens = self._reading.own_lens or self._lens
        return [rectified_doubt(self._reading.ros.image, lens)] if lens is not None else []

    def _take_lens(self, message: Any) -> None:
        if self._reading.own_lens is not None:
            return
        try:
            self._lens, self._lens_trouble = lens_of(message), ""
        except VisualMeshError as error:
            self._lens, self._lens_trouble = None, str(error)

    def _take_pose(self, message: Any, topic: str) -> None:
        try:
            if topic == "/tf_static":
                for each in message.transforms:
                    self._tree.add(each, None)
            elif topic == "/tf":
                for each in message.transforms:
                    self._tree.add(each, seconds_of(each.header.stamp))
            else:
                pose = orientation_of(Transform.from_message(message.pose), self._reading.pose.frame == "optical")
                self._poses.add(seconds_of(message.header.stamp), pose)
        except VisualMeshError as error:
            self._pose_trouble = str(error)

    def _has_pose(self, image: _Waiting) -> bool:
        """Whether there is a pose that is not older than an image; poses of tf are added here."""
        if self._reading.orientation is not None:
            return True
        if len(self._pose_topics) > 1:
            camera = self._reading.ros.camera_frame or image.message.header.frame_id
            try:
                pose = newest_pose(self._tree, self._reading.ros.plane_frame, camera, self._poses.newest, image.stamp)
                if pose is not None:
                    self._poses.add(*pose)
                self._pose_trouble = ""
            except VisualMeshError as error:
                self._pose_trouble = str(error)
        return self._poses.newest >= image.stamp

    def _frame(self, image: _Waiting) -> Frame:
        index, self._count = self._count, self._count + 1
        source = f"{self._name} at {image.stamp:.3f} s"
        orientation, trouble = self._reading.orientation, self._lens_trouble
        if orientation is None:
            try:
                orientation = self._reading.pose.corrected(self._poses.at(image.stamp))
            except StalePoseError as error:
                trouble = trouble or f"{self._pose_trouble or error}; give --height, or --pose-source topic:/NAME"
        reading = self._reading

        def read() -> Image:
            try:
                if trouble:
                    raise InputError(trouble)
                return image_of(image.message, reading.raw, reading.max_megapixels)
            except InputError as error:
                raise InputError(f"{source}: {error}") from error

        return Frame(
            index, source, Path(self._name).stem, read, stamp=image.stamp, lens=self._lens, orientation=orientation
        )
