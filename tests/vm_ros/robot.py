"""A robot that publishes a drawn scene over DDS as ROS does: images, camera_info, tf or poses."""

import threading
import time

import numpy as np
from scipy.spatial.transform import Rotation

from tests.vm_embedded.cameras.ros.rolling_ball import LENS, OFFSET, SIZE, Scene
from vm_embedded.cameras.ros.stamps import stamp_of
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA
from vm_ros.middleware import FIXED_TRANSFORMS

SECONDS, RATE = 4.0, 10.0
"""Length of the scene [s], which is shown forward and backward, and images per second [1/s]."""


class Robot:
    """Publishes in a thread: poses at 100 Hz, images at 10 Hz, drawn for the moments of their stamps.

    behind: by how much its clock is behind, as that of a bag that is played [s]. shown: time of each image since 1970
    on this clock [s], and the image.
    """

    def __init__(self, peer, poses="tf", behind=0.0):
        self._scene = Scene()
        draw = self._scene.camera.draw
        self._drawn = [draw(number / RATE) for number in range(int(SECONDS * RATE) + 1)]
        self._start, self._behind = 0.0, behind
        self.shown = {}
        self.has_camera = threading.Event()
        self.has_camera.set()
        self._types, self._poses = peer.types, poses
        advertise = peer.middleware.publisher
        self._images = advertise("/camera/image_raw", "Image")
        self._info = advertise("/camera/camera_info", "CameraInfo")
        self._tf = advertise("/tf", "TFMessage")
        self._fixed = peer.middleware.publisher("/tf_static", "TFMessage", FIXED_TRANSFORMS)
        self._pose = advertise("/camera_pose", "PoseStamped")
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stopping.set()
        self._thread.join(10.0)
        del self._images, self._info, self._tf, self._fixed, self._pose  # its writers leave, as those of a process do

    def orientation(self, now):
        """The camera's orientation at a time since 1970 [s]."""
        return self._scene.orientation(self._moment(now))

    def _moment(self, now):
        """The moment of the scene at a time since 1970 [s]."""
        return SECONDS - abs((now - self._start) % (2.0 * SECONDS) - SECONDS)

    def _run(self):
        types = self._types
        link = self._transform("camera", "camera_optical", 0.0, OPTICAL_TO_CAMERA, np.zeros(3))
        self._fixed.publish(types.TFMessage(transforms=[link]))
        self._start, due = round(time.time() - self._behind, 1), 0
        while not self._stopping.wait(0.01):
            now = time.time() - self._behind
            self._publish_pose(now)
            if now > self._start + due / RATE:
                if self.has_camera.is_set():
                    self._publish_image(round(self._start + due / RATE, 1))
                due += 1

    def _publish_pose(self, now):
        types, orientation = self._types, self.orientation(now)
        place = [*OFFSET, orientation.height]
        if self._poses == "tf":
            moving = self._transform("base_footprint", "camera", now, orientation.rotation, place)
            self._tf.publish(types.TFMessage(transforms=[moving]))
        else:
            header = types.Header(stamp=stamp_of(types, now), frame_id="base_footprint")
            position = types.Point(**named("xyz", place))
            pose = types.Pose(position=position, orientation=self._quaternion(orientation.rotation))
            self._pose.publish(types.PoseStamped(header=header, pose=pose))

    def _publish_image(self, now):
        types = self._types
        image = self._drawn[round(RATE * self._moment(now))]
        header = types.Header(stamp=stamp_of(types, now), frame_id="camera_optical")
        self.shown[now] = image
        self._info.publish(camera_info(types, header))
        self._images.publish(
            types.Image(
                header=header,
                height=SIZE[1],
                width=SIZE[0],
                encoding="bgr8",
                is_bigendian=0,
                step=3 * SIZE[0],
                data=image.tobytes(),
            )
        )

    def _transform(self, parent, child, now, rotation, place):
        types = self._types
        return types.TransformStamped(
            header=types.Header(stamp=stamp_of(types, now), frame_id=parent),
            child_frame_id=child,
            transform=types.Transform(
                translation=types.Vector3(**named("xyz", place)), rotation=self._quaternion(rotation)
            ),
        )

    def _quaternion(self, rotation):
        return self._types.Quaternion(**named("xyzw", Rotation.from_matrix(rotation).as_quat()))


def named(names, numbers):
    return {name: float(number) for name, number in zip(names, numbers, strict=True)}


def camera_info(types, header):
    (fx, fy), (cx, cy) = LENS.focal_lengths, LENS.optical_center
    return types.CameraInfo(
        header=header,
        height=SIZE[1],
        width=SIZE[0],
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=np.eye(3).ravel().tolist(),
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        binning_x=0,
        binning_y=0,
        roi=types.RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )
