"""The message types of bags: those of rosbags, with vision_msgs, which it lacks.

rosbags is an optional package. Only functions of this module import it.
"""

from __future__ import annotations

from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from ..errors import InputError, install_extra

MESSAGES = {
    "builtin_interfaces": ("Time",),
    "std_msgs": ("Header",),
    "sensor_msgs": ("Image", "CompressedImage", "CameraInfo", "RegionOfInterest"),
    "geometry_msgs": (
        "Point",
        "Quaternion",
        "Vector3",
        "Pose",
        "PoseStamped",
        "PoseWithCovariance",
        "Transform",
        "TransformStamped",
    ),
    "tf2_msgs": ("TFMessage",),
    "vision_msgs": (
        "Point2D",
        "Pose2D",
        "BoundingBox2D",
        "BoundingBox3D",
        "ObjectHypothesis",
        "ObjectHypothesisWithPose",
        "Detection2D",
        "Detection2DArray",
        "Detection3D",
        "Detection3DArray",
    ),
    "diagnostic_msgs": ("KeyValue", "DiagnosticStatus", "DiagnosticArray"),
}
"""All messages that this project reads and writes, by their ROS package."""

VISION_MSGS = {
    "Point2D": "float64 x\nfloat64 y",
    "Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "ObjectHypothesis": "string class_id\nfloat64 score",
    "ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox2D bbox\nstring id",
    "Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
    "vision_msgs/BoundingBox3D bbox\nstring id",
    "Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
}
"""Fields of vision_msgs 4, of ROS 2 Humble and later."""


def full_name(message: str) -> str:
    """The name of a message with its package, as in sensor_msgs/msg/Image."""
    return next(f"{package}/msg/{message}" for package, names in MESSAGES.items() if message in names)


def import_rosbags() -> ModuleType:
    """rosbags, with its readers, writers and types. Raises InputError if it is not installed."""
    try:
        import rosbags
        import rosbags.highlevel
        import rosbags.rosbag2
        import rosbags.typesys
    except ImportError as error:
        raise InputError(f"bags need the package rosbags ({error}); {install_extra('bags')}") from error
    return rosbags


@cache
def typestore() -> Any:
    """rosbags' types of ROS 2 Humble, with vision_msgs. Raises InputError if rosbags is not installed."""
    typesys = import_rosbags().typesys
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, fields in VISION_MSGS.items():
        store.register(typesys.get_types_from_msg(fields, full_name(name)))
    return store


@cache
def bag_types() -> SimpleNamespace:
    """The classes of all messages by their short names, and functions that make their arrays."""
    store = typestore()
    classes = {name: store.types[full_name(name)] for names in MESSAGES.values() for name in names}
    return SimpleNamespace(
        **classes,
        octets=lambda content: np.frombuffer(content, dtype=np.uint8),
        doubles=lambda numbers: np.array(numbers, dtype=np.float64),
    )
