"""The messages of a detector: one line of JSON for each frame, and one for each change of state.

`frame_fields` holds the fields that frames of files and of live cameras have in common. Every message of a live
detector has a state; only frames have detections.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..cameras.camera import Shot
from ..cameras.frame_source import Frame
from ..detection.detections import ClassPoints, Detections

STATES = ("starting", "ok", "degraded", "camera_lost", "pose_stale", "stopping")

Message = dict[str, Any]


def frame_fields(detections: Detections, emit_points: Sequence[str] = (), explain: bool = False) -> Message:
    """The result of a frame: number of mesh points, detections, features of the field, and time of each stage [ms].

    field: only for a network with classes of the field; without the points of the lines, so that a line stays short.
    emit_points: classes whose points are listed, with bearings (unit vectors in the plane's frame) and probabilities.
    explain: list rejected clusters too.
    """
    fields: Message = detections.as_dict()
    timing = fields.pop("timing_ms")  # the last entry of a message
    if emit_points:
        fields["class_points"] = {name: _class_points(detections.points_of(name)) for name in emit_points}
    if explain:
        fields["rejected"] = [each.as_dict() for each in detections.rejected]
    return fields | {"timing_ms": timing}


def _class_points(points: ClassPoints) -> Message:
    return {
        "bearings": np.round(points.bearings, 4).tolist(),
        "probabilities": np.round(points.probabilities.astype(float), 3).tolist(),
    }


def file_message(frame: Frame, detections: Detections, emit_points: Sequence[str], explain: bool) -> Message:
    """A frame of a file or folder. stamp: time in the video [s]; other fields as in `frame_fields`."""
    stamp = None if frame.stamp is None else round(frame.stamp, 6)
    origin = {"frame": frame.index, "source": frame.source, "stamp": stamp}
    return origin | frame_fields(detections, emit_points, explain)


def live_message(number: int, state: str, shot: Shot, detections: Detections, now: float) -> Message:
    """A frame of a live camera; now: current monotonic time [s].

    t: capture time, monotonic [s]. wall: the same since 1970 [s]. age_ms: time since capture. latency_ms: time since
    arrival. truth: what a synthetic camera knows about the frame.
    """
    message: Message = {
        "type": "frame",
        "state": state,
        "frame": number,
        "t": round(shot.captured, 6),
        "wall": round(time.time() - (time.monotonic() - shot.captured), 6),
        "age_ms": round(1e3 * (now - shot.captured), 3),
        "latency_ms": round(1e3 * (now - shot.arrived), 3),
        **frame_fields(detections),
    }
    if shot.truth:
        message["truth"] = shot.truth
    return message


def state_message(state: str, reason: str) -> Message:
    """The state of a live detector, without detections. t and wall: now, as in frames."""
    times = {"t": round(time.monotonic(), 6), "wall": round(time.time(), 6)}
    return {"type": "state", "state": state, **times, "reason": reason}


def to_json_line(message: Message) -> bytes:
    """A message as one line of compact JSON (RFC 8259: no NaN)."""
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def to_ros(message: Message, frame_id: str) -> Message:
    """A message with the field names of ROS 2: a vision_msgs/Detection2DArray, and a geometry_msgs/PointStamped for
    each detection, in the plane's frame `frame_id`. The state, which those types lack, is added. The features of the
    field are left out: those types have no place for them. A message with a state only has no arrays: an empty one
    would say that nothing is there."""
    seconds, rest = divmod(round(1e9 * message["wall"]), 10**9)
    header = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame_id}
    if "detections" not in message:
        return {"state": message["state"], "reason": message["reason"], "header": header}
    detections = message["detections"]
    return {
        "state": message["state"],
        "detections": {"header": header, "detections": [_ros_detection(header, each) for each in detections]},
        "points": [{"header": header, "point": _ros_point(each["position"])} for each in detections],
    }


def _ros_detection(header: Message, detection: Mapping[str, Any]) -> Message:
    pose = {"position": _ros_point(detection["position"]), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    x, y = detection["center"]
    return {
        "header": header,
        "id": str(detection["track"]["id"]) if "track" in detection else "",
        "results": [
            {
                "hypothesis": {"class_id": detection["class"], "score": detection["confidence"]},
                "pose": {"pose": pose, "covariance": [0.0] * 36},
            }
        ],
        "bbox": {
            "center": {"position": {"x": x, "y": y}, "theta": 0.0},
            "size_x": 2.0 * detection["radius"],
            "size_y": 2.0 * detection["radius"],
        },
    }


def _ros_point(position: list[float]) -> Message:
    return dict(zip("xyz", position, strict=True))
