"""A drawn ball that rolls past a swaying camera, as frames with lens files and as a bag of ROS 2, for tests."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from scipy.spatial.transform import Rotation

from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.ros.bag_types import bag_types, typestore
from vm_embedded.cameras.ros.message_fields import MESSAGES
from vm_embedded.cameras.synthetic import SyntheticCamera
from vm_embedded.geometry.calibrated_lenses import BrownLens
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import OPTICAL_TO_CAMERA

TYPES = bag_types()
START = 1_800_000_000
"""When the bag starts, in seconds since 1970."""

SIZE = (640, 512)
LENS = BrownLens(
    focal_lengths=(448.0, 448.0),
    optical_center=(319.5, 255.5),
    coefficients=(0.0, 0.0, 0.0, 0.0, 0.0),
    fov=np.radians(160.0),
    size=SIZE,
)
OFFSET = np.array([0.05, 0.02])
"""Where the camera is in the plane's frame [m]."""


def stamp(time):
    seconds, rest = divmod(round(1e9 * time), 10**9)
    return TYPES.Time(sec=START + seconds, nanosec=rest)


def quaternion(rotation):
    return TYPES.Quaternion(**dict(zip("xyzw", Rotation.from_matrix(rotation).as_quat().tolist(), strict=True)))


def transform(parent, child, time, rotation, translation):
    return TYPES.TransformStamped(
        header=TYPES.Header(stamp=stamp(time), frame_id=parent),
        child_frame_id=child,
        transform=TYPES.Transform(
            translation=TYPES.Vector3(**dict(zip("xyz", map(float, translation), strict=True))),
            rotation=quaternion(rotation),
        ),
    )


def image_message(image, time, frame_id="camera_optical", encoding="bgr8"):
    height, width = image.shape[:2]
    image = np.ascontiguousarray(image)
    return TYPES.Image(
        header=TYPES.Header(stamp=stamp(time), frame_id=frame_id),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=image.strides[0],
        data=image.reshape(-1),
    )


def camera_info(time, frame_id="camera_optical"):
    (fx, fy), (cx, cy) = LENS.focal_lengths, LENS.optical_center
    return TYPES.CameraInfo(
        header=TYPES.Header(stamp=stamp(time), frame_id=frame_id),
        height=SIZE[1],
        width=SIZE[0],
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        r=np.eye(3).reshape(-1),
        p=np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=TYPES.RegionOfInterest(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


@dataclass
class Scene:
    """Images of a camera at 25 frames per second. shift [s]: of the images against tf, which comes at 100 Hz."""

    count: int = 100
    shift: float = 0.0

    @cached_property
    def camera(self):
        return SyntheticCamera(CameraSettings(source="synthetic"))

    @cached_property
    def images(self):
        """Times [s] and images."""
        times = [round(0.04 * each + 0.2 + self.shift, 6) for each in range(self.count)]
        return [(time, self.camera.draw(time)) for time in times]

    def orientation(self, time):
        return self.camera.motion.orientation(time)

    def write_frames(self, folder):
        """Write each image with its lens file."""
        folder.mkdir()
        for number, (time, image) in enumerate(self.images):
            cv2.imwrite(str(folder / f"image{number:03d}.png"), image)
            (folder / f"lens{number:03d}.yaml").write_text(format_lens_file(LENS, self.orientation(time)))

    def messages(self):
        """All messages in the order of their times [s]: topic, name of the type, message."""
        fixed = transform("camera", "camera_optical", 0.0, OPTICAL_TO_CAMERA, np.zeros(3))
        found = [(0.0, "/tf_static", "TFMessage", TYPES.TFMessage(transforms=[fixed]))]
        for time in (0.01 * np.arange(4 * self.count + 60)).round(6).tolist():
            pose = self.orientation(time)
            moving = transform("base_footprint", "camera", time, pose.rotation, [*OFFSET, pose.height])
            found.append((time + 0.002, "/tf", "TFMessage", TYPES.TFMessage(transforms=[moving])))
        for time, image in self.images:
            found.append((time + 0.001, "/camera/camera_info", "CameraInfo", camera_info(time)))
            found.append((time + 0.001, "/camera/image_raw", "Image", image_message(image, time)))
        return sorted(found, key=lambda each: each[0])

    def write_bag(self, folder, storage=StoragePlugin.MCAP, without=()):
        """Write a bag without some topics, and return its file."""
        write_messages(folder, (each for each in self.messages() if each[1] not in without), storage)
        return next(each for each in folder.iterdir() if each.suffix != ".yaml")


def write_messages(folder, messages, storage=StoragePlugin.MCAP):
    """Write messages into a bag: time [s] after START, topic, name of the type, message."""
    store, connections = typestore(), {}
    with Writer(folder, version=9, storage_plugin=storage) as writer:
        for time, topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, MESSAGES[kind], typestore=store)
            data = store.serialize_cdr(message, MESSAGES[kind])
            writer.write(connections[topic], START * 10**9 + round(1e9 * time), data)
