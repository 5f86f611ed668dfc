"""Write images, lenses, poses, detections and states into an MCAP file, for Foxglove and as a bag of ROS 2."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ...cameras.frame_source import Frame
from ...cameras.ros.bag_types import bag_types, import_rosbags, typestore
from ...cameras.ros.images import jpeg_message
from ...cameras.ros.lens import camera_info_message
from ...cameras.ros.message_fields import MESSAGES
from ...cameras.ros.settings import MAP, NODE
from ...cameras.ros.stamps import stamp_of
from ...cameras.ros.transforms import transform_message
from ...detection.detections import Detections
from ...errors import InputError
from ...files import check_writable, put_in_place, real_path, unused_name
from ...geometry.lens import Lens
from ...geometry.orientation import Orientation
from .annotations import image_annotations
from .detection_messages import FrameResults, diagnostic_array, header_of
from .topics import TOPICS

_CAMERA_FRAME = "camera_optical"
_RATE = 5.0
"""Rate of frames without a time [1/s]: so slow that a bag's reader does not take the poses of unrelated images for
jumps of one camera."""

_ONE_DAY = 86400.0


class McapFile:
    """An MCAP file that frames are written into; a context manager.

    The file appears when it is closed; until then, its content is in a hidden folder beside it, under a name that
    nothing has. plane_frame: name of the frame of the observation plane. inputs: files that it must not replace. Raises
    InputError if rosbags is missing, or the file can't be written.
    """

    def __init__(self, path: Path, plane_frame: str, inputs: Sequence[Path] = ()) -> None:
        if path.suffix.lower() != ".mcap":
            raise InputError(f"an MCAP file must end in .mcap, not {path.name!r}")
        check_writable(path, inputs)
        self._path, self._plane_frame = path, plane_frame
        self._target = real_path(path)
        self._part = unused_name(self._target)
        rosbags = import_rosbags()
        self._store, self._types = typestore(), bag_types()
        mcap = rosbags.rosbag2.StoragePlugin.MCAP
        self._writer = rosbags.rosbag2.Writer(self._part / "bag", version=9, storage_plugin=mcap)
        self._failure: OSError | None = None
        try:
            self._part.mkdir()
        except OSError as error:
            raise InputError(f"can't write {path}: {error.strerror or error}") from error
        try:
            self._writer.open()
        except OSError as error:
            self._discard()
            raise InputError(f"can't write {path}: {error.strerror or error}") from error
        self._connections: dict[str, Any] = {}
        self._start = time.time()

    def write(self, frame: Frame, lens: Lens, orientation: Orientation, detections: Detections) -> None:
        """Write a frame with its detections, and the state ok.

        Raises OSError on a full disk; as the context ends, an InputError with the file takes its place.
        """
        types, now = self._types, self._time(frame)
        stamp = stamp_of(types, now)
        in_image, on_plane = header_of(types, stamp, _CAMERA_FRAME), header_of(types, stamp, self._plane_frame)
        image = detections.observation.pyramid.bgr()
        height, width = image.shape[:2]
        info = camera_info_message(types, in_image, lens, (width, height))
        pose = transform_message(types, on_plane, _CAMERA_FRAME, orientation)
        self._add(now, "/tf", "TFMessage", types.TFMessage(transforms=[pose]))
        self._add(now, "/camera/camera_info", "CameraInfo", info)
        self._add(now, "/camera/image/compressed", "CompressedImage", jpeg_message(types, in_image, image))
        results = FrameResults(types, in_image, on_plane, detections, orientation, np.zeros(2))
        for name, (kind, make) in TOPICS.items():
            message = make(results)
            if message is not None:
                self._add(now, f"/{NODE}/{name}", kind, message)
        self._add(now, f"/{NODE}/annotations", "ImageAnnotations", image_annotations(types, stamp, detections))
        drawn = jpeg_message(types, on_plane, detections.draw_map())
        self._add(now, f"/{NODE}/{MAP}", "CompressedImage", drawn)
        self.write_state(frame, "ok", "")

    def write_state(self, frame: Frame, state: str, reason: str) -> None:
        """Write the state at a frame: ok, or degraded with the reason why it was not processed.

        Raises OSError as `write` does.
        """
        now = self._time(frame)
        message = diagnostic_array(
            self._types,
            stamp_of(self._types, now),
            f"{NODE}: detector",
            state,
            reason,
            {"frame": frame.index},
            frame.source,
        )
        self._add(now, "/diagnostics", "DiagnosticArray", message)

    def _time(self, frame: Frame) -> float:
        """Seconds since 1970: the stamp of a bag; else the start of this run and the time in the video."""
        if frame.stamp is not None and frame.stamp > _ONE_DAY:
            return frame.stamp
        return self._start + (frame.stamp if frame.stamp is not None else frame.index / _RATE)

    def _add(self, now: float, topic: str, kind: str, message: Any) -> None:
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, MESSAGES[kind], typestore=self._store)
        data = self._store.serialize_cdr(message, MESSAGES[kind])
        try:
            self._writer.write(self._connections[topic], round(1e9 * now), data)
        except OSError as error:
            self._failure = error
            raise

    def __enter__(self) -> McapFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the file, also after an error: it has the frames until then. Without any frame, no file is written.

        Raises InputError if it could not be written as a whole, for example on a full disk. Without its end it would be
        unreadable, so nothing of it stays.
        """
        if not self._connections:
            self._discard()
            return
        try:
            if self._failure is not None:
                raise self._failure
            self._writer.close()
            written = next(self._part.glob("bag/*.mcap"))
        except OSError as failure:
            self._discard()
            raise InputError(f"can't write {self._path}: {failure.strerror or failure}") from failure
        try:
            put_in_place(written, self._target)
        except OSError as failure:
            raise InputError(
                f"can't write {self._path}: {failure.strerror or failure}; it is in {written}"
            ) from failure
        shutil.rmtree(self._part, ignore_errors=True)

    def _discard(self) -> None:
        """Remove what was written."""
        with suppress(OSError):  # the disk may still be full
            self._writer.abort()
        shutil.rmtree(self._part, ignore_errors=True)
