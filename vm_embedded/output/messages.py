"""What a running detector says: a line of JSON for each frame, and one whenever its state changes.

Each has a state; a frame's has detections, and only a frame's has any.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from typing import Any

from ..cameras.camera import Shot
from ..detection.detections import Detections

STATES = ("starting", "ok", "degraded", "camera_lost", "pose_stale", "stopping")

Message = dict[str, Any]


def frame_message(number: int, state: str, shot: Shot, detections: Detections, now: float) -> Message:
    """What a frame shows. t: when it was taken, monotonic [s]; wall: the same since 1970 [s]; age_ms: since
    then; latency_ms: since it had arrived."""
    message: Message = {
        "type": "frame",
        "state": state,
        "frame": number,
        "t": round(shot.captured, 6),
        "wall": round(time.time() - (time.monotonic() - shot.captured), 6),
        "age_ms": round(1e3 * (now - shot.captured), 3),
        "latency_ms": round(1e3 * (now - shot.arrived), 3),
        "points": len(detections.pixels),
        "detections": [each.as_dict() for each in detections],
        "timing_ms": {stage: round(value, 3) for stage, value in detections.timing_ms.items()},
    }
    if shot.truth:
        message["truth"] = shot.truth
    return message


def state_message(state: str, reason: str) -> Message:
    """How the detector is, and no detections. t as in frames."""
    times = {"t": round(time.monotonic(), 6), "wall": round(time.time(), 6)}
    return {"type": "state", "state": state, **times, "reason": reason}


def to_json_line(message: Message) -> bytes:
    """A message as a line (RFC 8259: no NaN)."""
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"


def to_ros(message: Message, frame_id: str) -> Message:
    """A message with the field names of ROS 2: vision_msgs/Detection2DArray, and a geometry_msgs/PointStamped for each
    detection, in the plane's frame `frame_id`. The state goes along, which ROS does not know."""
    seconds, rest = divmod(round(1e9 * message["wall"]), 10**9)
    header = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame_id}
    found = message.get("detections", [])
    return {
        "state": message["state"],
        "detections": {"header": header, "detections": [_detection(header, each) for each in found]},
        "points": [{"header": header, "point": _point(each["position"])} for each in found],
    }


def _detection(header: Message, found: Mapping[str, Any]) -> Message:
    pose = {"position": _point(found["position"]), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    x, y = found["center"]
    return {
        "header": header,
        "id": "",
        "results": [
            {
                "hypothesis": {"class_id": found["class"], "score": found["confidence"]},
                "pose": {"pose": pose, "covariance": [0.0] * 36},
            }
        ],
        "bbox": {
            "center": {"position": {"x": x, "y": y}, "theta": 0.0},
            "size_x": 2.0 * found["radius"],
            "size_y": 2.0 * found["radius"],
        },
    }


def _point(position: list[float]) -> Message:
    return dict(zip("xyz", position, strict=True))
