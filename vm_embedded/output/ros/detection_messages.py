"""Detections and states as messages of ROS: vision_msgs 4 (ROS 2 Humble and later) and diagnostic_msgs.

`types` is a set of message classes that are called with all their fields: of vm_ros or of rosbags.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays import Floats
from ...detection.detection import Detection
from ...detection.detections import Detections
from ...geometry.orientation import OPTICAL_TO_CAMERA, Orientation

_LEVELS = {"ok": "OK", "starting": "WARN", "degraded": "WARN", "stopping": "WARN"}
"""Levels of a DiagnosticStatus for states; the others, without detections, are errors."""


@dataclass(frozen=True, eq=False)
class FrameResults:
    """What the messages of a frame are made from.

    in_image, on_plane: std_msgs/Header with the stamp of the image, and the frame of the camera, with optical axes, or
    of the observation plane. orientation: that the detections were computed with. offset (2,) [m]: where the camera is
    in the frame of the plane; zeros if its origin is below the camera.
    """

    types: Any
    in_image: Any
    on_plane: Any
    detections: Detections
    orientation: Orientation
    offset: Floats

    def points(self, positions: Floats) -> list[Any]:
        """geometry_msgs/Point at positions (n, 2) or (n, 3) [m] of Detections."""
        point, (east, north) = self.types.Point, self.offset.tolist()
        return [point(x=x + east, y=y + north, z=z[0] if z else 0.0) for x, y, *z in positions.tolist()]

    def point(self, position: Floats) -> Any:
        """A geometry_msgs/Point at a position (2,) or (3,) [m] of Detections."""
        return self.points(position[None])[0]

    def pose(self, position: Floats) -> Any:
        """A geometry_msgs/Pose at a position as that of `point`, not rotated."""
        return _pose(self.types, self.point(position))


def header_of(types: Any, stamp: Any, frame_id: str) -> Any:
    """A std_msgs/Header."""
    return types.Header(stamp=stamp, frame_id=frame_id)


def detection_2d_array(frame: FrameResults) -> Any:
    """A Detection2DArray: boxes in the image [px], and positions in the camera's optical frame [m]."""
    return frame.types.Detection2DArray(
        header=frame.in_image, detections=[_detection_2d(frame, each) for each in frame.detections]
    )


def detection_3d_array(frame: FrameResults) -> Any:
    """A Detection3DArray: positions and boxes in the frame of the observation plane [m]."""
    return frame.types.Detection3DArray(
        header=frame.on_plane, detections=[_detection_3d(frame, each) for each in frame.detections]
    )


def _detection_2d(frame: FrameResults, detection: Detection) -> Any:
    types = frame.types
    # The bearing leads from the camera to the object, in the plane's frame.
    position = detection.distance * (frame.orientation.rotation @ OPTICAL_TO_CAMERA).T @ detection.bearing
    pose = _pose(types, types.Point(**dict(zip("xyz", position.tolist(), strict=True))))
    return types.Detection2D(
        header=frame.in_image,
        results=[_hypothesis(types, detection, pose)],
        bbox=object_box(types, detection),
        id=_track_id(detection),
    )


def object_box(types: Any, detection: Detection) -> Any:
    """A BoundingBox2D of the outline of a detection [px]."""
    around = np.array([detection.center - detection.radius, detection.center + detection.radius])
    return box_around(types, detection.outline if len(detection.outline) else around)


def box_around(types: Any, pixels: Floats) -> Any:
    """A BoundingBox2D around pixels (n, 2)."""
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    (x, y), (width, height) = (0.5 * (low + high)).tolist(), (high - low).tolist()
    center = types.Pose2D(position=types.Point2D(x=x, y=y), theta=0.0)
    return types.BoundingBox2D(center=center, size_x=width, size_y=height)


def _detection_3d(frame: FrameResults, detection: Detection) -> Any:
    types, side = frame.types, 2.0 * frame.detections.manifest.object_radius
    return types.Detection3D(
        header=frame.on_plane,
        results=[_hypothesis(types, detection, frame.pose(detection.position))],
        bbox=types.BoundingBox3D(center=frame.pose(detection.position), size=types.Vector3(x=side, y=side, z=side)),
        id=_track_id(detection),
    )


def _track_id(detection: Detection) -> str:
    """The number of its track, or an empty text."""
    return "" if detection.track is None else str(detection.track.id)


def _hypothesis(types: Any, detection: Detection, pose: Any) -> Any:
    return types.ObjectHypothesisWithPose(
        hypothesis=types.ObjectHypothesis(class_id=detection.class_name, score=float(detection.confidence)),
        pose=types.PoseWithCovariance(pose=pose, covariance=types.doubles([0.0] * 36)),
    )


def _pose(types: Any, point: Any) -> Any:
    return types.Pose(position=point, orientation=types.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))


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
