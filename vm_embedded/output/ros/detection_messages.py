"""Detections and states as messages of ROS: vision_msgs 4 (ROS 2 Humble and later) and diagnostic_msgs.

`types` is a set of message classes that are called with all their fields: of rclpy, of vm_ros, or of rosbags.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Floats
from ...detection.detection import Detection
from ...detection.detections import Detections
from ...geometry.orientation import OPTICAL_TO_CAMERA, Orientation

_LEVELS = {"ok": "OK", "starting": "WARN", "degraded": "WARN", "stopping": "WARN"}
"""Levels of a DiagnosticStatus for states; the others, without detections, are errors."""


def header_of(types: Any, stamp: Any, frame_id: str) -> Any:
    """A std_msgs/Header."""
    return types.Header(stamp=stamp, frame_id=frame_id)


def detection_2d_array(types: Any, header: Any, detections: Detections, orientation: Orientation) -> Any:
    """A Detection2DArray: boxes in the image [px], and positions in the camera's optical frame [m].

    header: of the image. orientation: that the detections were computed with.
    """
    return types.Detection2DArray(
        header=header, detections=[_detection_2d(types, header, each, orientation) for each in detections]
    )


def detection_3d_array(types: Any, header: Any, detections: Detections, offset: Floats) -> Any:
    """A Detection3DArray: positions and boxes in the frame of the observation plane [m].

    header: with the stamp of the image, and the frame of the plane. offset (2,) [m]: where the camera is in that frame;
    zeros if its origin is below the camera.
    """
    side = 2.0 * detections.manifest.object_radius
    return types.Detection3DArray(
        header=header, detections=[_detection_3d(types, header, each, offset, side) for each in detections]
    )


def _detection_2d(types: Any, header: Any, detection: Detection, orientation: Orientation) -> Any:
    around = np.array([detection.center - detection.radius, detection.center + detection.radius])
    points = detection.outline if len(detection.outline) else around
    low, high = points.min(axis=0), points.max(axis=0)
    (x, y), (width, height) = 0.5 * (low + high), high - low
    # The bearing leads from the camera to the object, in the plane's frame.
    position = detection.distance * (orientation.rotation @ OPTICAL_TO_CAMERA).T @ detection.bearing
    return types.Detection2D(
        header=header,
        results=[_hypothesis(types, detection, position)],
        bbox=types.BoundingBox2D(
            center=types.Pose2D(position=types.Point2D(x=float(x), y=float(y)), theta=0.0),
            size_x=float(width),
            size_y=float(height),
        ),
        id=_track_id(detection),
    )


def _detection_3d(types: Any, header: Any, detection: Detection, offset: Floats, side: float) -> Any:
    position = detection.position + np.append(offset, 0.0)
    return types.Detection3D(
        header=header,
        results=[_hypothesis(types, detection, position)],
        bbox=types.BoundingBox3D(center=_pose_at(types, position), size=types.Vector3(x=side, y=side, z=side)),
        id=_track_id(detection),
    )


def _track_id(detection: Detection) -> str:
    """The number of its track, or an empty text."""
    return "" if detection.track is None else str(detection.track.id)


def _hypothesis(types: Any, detection: Detection, position: Floats) -> Any:
    return types.ObjectHypothesisWithPose(
        hypothesis=types.ObjectHypothesis(class_id=detection.class_name, score=float(detection.confidence)),
        pose=types.PoseWithCovariance(pose=_pose_at(types, position), covariance=types.doubles([0.0] * 36)),
    )


def _pose_at(types: Any, position: Floats) -> Any:
    """A geometry_msgs/Pose at a position (3,), not rotated."""
    x, y, z = (float(each) for each in position)
    return types.Pose(position=types.Point(x=x, y=y, z=z), orientation=types.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


def diagnostic_array(
    types: Any, stamp: Any, name: str, state: str, reason: str, values: Mapping[str, object], hardware: str
) -> Any:
    """A DiagnosticArray with the state of the detector, its reason, and further values.

    name: of the status, such as "vm_ros: detector". hardware: the camera.
    """
    level = getattr(types.DiagnosticStatus, _LEVELS.get(state, "ERROR"))
    pairs = {"state": state, "reason": reason, **values}
    status = types.DiagnosticStatus(
        level=level,
        name=name,
        message=f"{state}: {reason}" if reason else state,
        hardware_id=hardware,
        values=[types.KeyValue(key=key, value=str(value)) for key, value in pairs.items()],
    )
    return types.DiagnosticArray(header=header_of(types, stamp, ""), status=[status])
