"""The node: images, lenses and poses of ROS go to the daemon, its detections and states go to ROS.

Messages arrive in the thread of the middleware. Poses are handed to the event loop; images wait for the thread that
reads the camera. Arrays of detections leave in a thread of their own.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats, Image
from vm_embedded.borders.clock import wall_offset
from vm_embedded.borders.credentials import without_password
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.open_camera import ROS, Opener, camera_opener
from vm_embedded.cameras.ros.camera_poses import newest_pose, orientation_of
from vm_embedded.cameras.ros.images import jpeg_message
from vm_embedded.cameras.ros.lens import lens_of
from vm_embedded.cameras.ros.settings import DEBUG_IMAGE, MAP, NODE, camera_info_beside
from vm_embedded.cameras.ros.stamps import StampClock, seconds_of, stamp_of
from vm_embedded.cameras.ros.transforms import Transform, TransformTree
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.geometry.lens import Lens
from vm_embedded.live.answering import Answer
from vm_embedded.live.configuration import Configuration
from vm_embedded.output.messages import Message
from vm_embedded.output.ros.detection_messages import FrameResults, diagnostic_array, header_of
from vm_embedded.output.ros.topics import TOPICS
from vm_embedded.poses.stream import PoseStream

from .middleware import FIXED_TRANSFORMS, POSES, SENSOR, TRANSFORMS, Middleware
from .topic_camera import Newest, RosShot, TopicCamera

IMAGE = "/camera/image_raw"
"""Topic of the images if the configuration has none."""

_DIAGNOSTICS_PERIOD = 1.0
"""Longest time between two messages with the state [s]."""

_DRAWING_PERIOD = 0.1
"""Least time between two drawings [s]: image and map take longer than the detection of balls."""

_FIXED_POSE_PERIOD = 0.02
"""Time between two poses of a camera that is fixed to the plane, and whose images do not come from ROS [s]."""

_CAMERA_FRAME = "camera"
"""Frame of images that do not come from ROS, if the configuration has none."""


class Node:
    """Connects the daemon to ROS; it is the daemon's Bridge."""

    def __init__(self, configuration: Configuration, middleware: Middleware) -> None:
        self._ros, self._pose, self._camera = configuration.ros, configuration.pose, configuration.camera
        self._has_lens = configuration.lens is not None
        self._middleware, types = middleware, middleware.types
        self._types = types
        image = self._ros.image or IMAGE
        self._info_topic = self._ros.camera_info or camera_info_beside(image)
        self._images = Newest(image)
        self._clock = StampClock(self._ros.clock)
        self._info: Any = None  # the newest
        self._read_info: Any = None  # that of the lens
        self._lens: Lens | None = None
        self._tree = TransformTree()
        self._camera_frame = self._ros.camera_frame or ("" if self._camera.source == ROS else _CAMERA_FRAME)
        self._image_time = -np.inf
        self._reported = ("", -np.inf)  # state, and when it was published
        self._drawing: asyncio.Task[None] | None = None
        self._drawn = -np.inf  # when the last one began [s, monotonic]
        self._sender = ThreadPoolExecutor(1, "publish")
        self._sent: Future[None] | None = None
        prefix = self._ros.namespace.rstrip("/")
        self._publishers = [
            (middleware.publisher(f"{prefix}/{name}", message), make)
            for name, (message, make) in TOPICS.items()
            if hasattr(types, message)
        ]
        self._debug_image = middleware.publisher(f"{prefix}/{DEBUG_IMAGE}", "CompressedImage")
        self._map = middleware.publisher(f"{prefix}/{MAP}", "CompressedImage")
        self._diagnostics = middleware.publisher("/diagnostics", "DiagnosticArray")

    def opener(self, settings: CameraSettings, raw: bool) -> Opener:
        """Return a function that opens the topic of images, or another camera."""
        if settings.source != ROS:
            return camera_opener(settings, raw)
        return lambda: TopicCamera(self._images, settings, raw, self._lens_of_camera)

    async def open(self, poses: PoseStream) -> None:
        """Subscribe to images, lens and poses."""
        self._poses, self._loop = poses, asyncio.get_running_loop()
        subscribe = self._middleware.subscribe
        if self._camera.source == ROS:
            kind = "CompressedImage" if self._images.topic.endswith("/compressed") else "Image"
            subscribe(self._images.topic, kind, self._take_image, SENSOR)
            subscribe(self._info_topic, "CameraInfo", self._take_info, SENSOR)
        if self._pose.source == "tf":
            subscribe("/tf", "TFMessage", lambda message: self._hand_over(self._take_transforms, message), TRANSFORMS)
            subscribe(
                "/tf_static",
                "TFMessage",
                lambda message: self._hand_over(self._take_fixed_transforms, message),
                FIXED_TRANSFORMS,
            )
            if self._camera.source != ROS:
                self._follow_time()
        elif self._pose.source.startswith("topic:"):
            topic = self._pose.source.removeprefix("topic:")
            subscribe(topic, "PoseStamped", lambda message: self._hand_over(self._take_pose, message), POSES)
        self._middleware.start()

    async def close(self) -> None:
        """Disconnect."""
        try:
            if self._drawing is not None:
                await self._drawing
            if self._sent is not None:
                await asyncio.wrap_future(self._sent)
        finally:
            self._sender.shutdown()
            await asyncio.to_thread(self._middleware.close)

    def publish(self, message: Message, answer: Answer | None) -> None:
        """Publish what a frame shows, and at each change and once per second the state. No frame, no arrays."""
        if answer is not None:
            self._publish_detections(answer)
        now = time.monotonic()
        if message["state"] != self._reported[0] or answer is None or now - self._reported[1] > _DIAGNOSTICS_PERIOD:
            self._reported = message["state"], now
            self._publish_state(message)

    def _publish_detections(self, answer: Answer) -> None:
        types, shot = self._types, answer.shot
        if isinstance(shot, RosShot):
            stamp, frame_id = shot.stamp, shot.frame_id
        else:
            stamp = stamp_of(types, shot.captured + wall_offset())
            frame_id = self._camera_frame
        detections = answer.detections
        try:
            offset = self._camera_offset(shot.captured)
        except InputError as error:  # tf has changed since the pose of this frame
            self._poses.reject(str(error))
            return
        in_image, on_plane = (header_of(types, stamp, each) for each in (frame_id, self._ros.plane_frame))
        frame = FrameResults(types, in_image, on_plane, detections, answer.orientation, offset)
        sent, self._sent = self._sent, None
        if sent is not None:
            sent.result()  # no more than a frame waits for slow readers, and no error is lost
        self._sent = self._sender.submit(self._send, frame)
        now, is_free = time.monotonic(), self._drawing is None or self._drawing.done()
        if is_free and now - self._drawn >= _DRAWING_PERIOD and (self._debug_image.readers or self._map.readers):
            self._drawn = now
            self._drawing = asyncio.ensure_future(asyncio.to_thread(self._publish_drawings, frame, shot.image))

    def _send(self, frame: FrameResults) -> None:
        """Publish the arrays of a frame: half a millisecond for each topic that is read, so not in the event loop."""
        for publisher, make in self._publishers:
            message = make(frame) if publisher.readers else None
            if message is not None:
                publisher.publish(message)

    def _publish_drawings(self, frame: FrameResults, image: Image) -> None:
        if self._debug_image.readers:
            self._debug_image.publish(jpeg_message(frame.types, frame.in_image, frame.detections.draw(image)))
        if self._map.readers:
            self._map.publish(jpeg_message(frame.types, frame.on_plane, frame.detections.draw_map()))

    def _camera_offset(self, captured: float) -> Floats:
        """Where the camera is in the plane's frame (2,) [m]; zeros if its origin is below the camera.

        Raises InputError if tf does not know it.
        """
        if self._pose.source != "tf":
            return np.zeros(2)
        return self._tree.at(self._ros.plane_frame, self._camera_frame, captured).translation[:2]

    def _publish_state(self, message: Message) -> None:
        names = ("frame", "age_ms", "latency_ms", "points")
        values: dict[str, object] = {name: message[name] for name in names if name in message}
        self._diagnostics.publish(
            diagnostic_array(
                self._types,
                stamp_of(self._types, time.time()),
                f"{NODE}: detector",
                message["state"],
                message.get("reason", ""),
                values,
                self._images.topic if self._camera.source == ROS else without_password(self._camera.source),
            )
        )

    def _hand_over(self, take: Callable[[Any, float], None], message: Any) -> None:
        """Have a message taken in the event loop, if it still runs."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(take, message, time.monotonic())

    def _take_image(self, message: Any) -> None:
        captured = self._clock.monotonic(seconds_of(message.header.stamp), time.monotonic())
        self._images.put(message, captured)
        if self._pose.source == "tf":
            self._hand_over(lambda *_: self._follow_image(message.header.frame_id, captured), None)

    def _take_info(self, message: Any) -> None:
        self._info = message

    def _lens_of_camera(self) -> Lens | None:
        """The lens of camera_info; None if the configuration has a lens. Raises InputError without any."""
        if self._has_lens:
            return None
        info = self._info
        if info is not self._read_info:
            lens = lens_of(info)
            self._lens = self._lens if lens == self._lens else lens  # the same object, for caches
            self._read_info = info
        if self._lens is None:
            raise InputError(f"no message on {self._info_topic} yet; publish it, or give --lens")
        return self._lens

    def _follow_image(self, frame_id: str, captured: float) -> None:
        self._camera_frame = self._ros.camera_frame or frame_id
        self._image_time = captured
        self._add_tf_pose()

    def _follow_time(self) -> None:
        """Take now as the time of images that do not come from ROS, for a camera that is fixed to the plane."""
        self._image_time = time.monotonic()
        self._add_tf_pose()
        self._loop.call_later(_FIXED_POSE_PERIOD, self._follow_time)

    def _take_transforms(self, message: Any, now: float) -> None:
        self._add_transforms(message, lambda each: self._clock.monotonic(seconds_of(each.header.stamp), now))

    def _take_fixed_transforms(self, message: Any, _: float) -> None:
        self._add_transforms(message, lambda _: None)

    def _add_transforms(self, message: Any, time_of: Callable[[Any], float | None]) -> None:
        for each in message.transforms:
            try:
                self._tree.add(each, time_of(each))
            except VisualMeshError as error:
                self._poses.reject(f"tf of {each.child_frame_id}: {error}")
        self._add_tf_pose()

    def _add_tf_pose(self) -> None:
        """Give the daemon the newest pose that tf knows."""
        if not self._camera_frame:
            return
        try:
            pose = newest_pose(
                self._tree, self._ros.plane_frame, self._camera_frame, self._poses.poses.newest, self._image_time
            )
        except VisualMeshError as error:
            self._poses.reject(str(error))
            return
        if pose is not None:
            self._poses.add(*pose)

    def _take_pose(self, message: Any, now: float) -> None:
        try:
            pose = orientation_of(Transform.from_message(message.pose), self._pose.frame == "optical")
        except VisualMeshError as error:
            self._poses.reject(f"pose: {error}")
            return
        self._poses.add(self._clock.monotonic(seconds_of(message.header.stamp), now), pose)
