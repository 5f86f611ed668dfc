"""The messages of a detector: one line of JSON for each frame, and one for each change of state.

Every message of a live detector has a state; only frames have detections.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from ..borders.clock import wall_offset
from ..borders.records import SIZE, Record, Sent
from ..cameras.camera import Shot
from ..cameras.frame_source import Frame
from ..detection.detection import Detection
from ..detection.detections import ClassPoints, Detections, Results, results

STATES = ("starting", "ok", "degraded", "camera_lost", "pose_stale", "stopping")

_TIME = Sent(6)

Message = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class _FileOrigin(Record):
    """Where a frame of a file comes from.

    frame: number of the frame; the first is 0. source: name of the file. stamp [s]: time in a video or recording, or of
    an image in a bag; null for an image.
    """

    frame: Annotated[int, SIZE]
    source: Annotated[str, Sent()]
    stamp: Annotated[float | None, Sent(6, null=True)]


@dataclass(frozen=True, kw_only=True)
class FileFrame(Results, _FileOrigin):
    """A frame of a file or folder.

    class_points: points of the classes of --emit-points, by name. rejected: rejected proposals or clusters, each with
    its reason; with --explain.
    """

    class_points: Annotated[Mapping[str, ClassPoints] | None, Sent()] = None
    rejected: Annotated[tuple[Detection, ...] | None, Sent()] = None


@dataclass(frozen=True, kw_only=True)
class _LiveOrigin(Record):
    """Where a frame of a live camera comes from.

    type: kind of the message. state: state of the detector; a frame never has camera_lost. frame: number of the frame,
    from 1. t [s]: time of capture on the monotonic clock. wall [s]: time of capture since 1970. age_ms [ms]: time from
    capture to the message. latency_ms [ms]: time from the frame's arrival to the message.
    """

    type: Annotated[str, Sent(allowed=("frame",))] = "frame"
    state: Annotated[str, Sent(allowed=STATES)]
    frame: Annotated[int, Sent(least=1)]
    t: Annotated[float, _TIME]
    wall: Annotated[float, _TIME]
    age_ms: Annotated[float, Sent()]
    latency_ms: Annotated[float, Sent()]


@dataclass(frozen=True, kw_only=True)
class LiveFrame(Results, _LiveOrigin):
    """A frame of a live camera.

    truth: what the camera synthetic knows about its scene: the true center of the ball in the plane's frame [m].
    """

    truth: Annotated[Mapping[str, Any] | None, Sent()] = None


@dataclass(frozen=True, kw_only=True)
class StateMessage(Record):
    """A state of a live detector, without detections.

    type: kind of the message. state: state of the detector. t [s]: time of the message on the monotonic clock. wall
    [s]: time of the message since 1970. reason: why the detector is in this state; it may be empty.
    """

    type: Annotated[str, Sent(allowed=("state",))] = "state"
    state: Annotated[str, Sent(allowed=STATES)]
    t: Annotated[float, _TIME]
    wall: Annotated[float, _TIME]
    reason: Annotated[str, Sent()]


@dataclass(frozen=True, kw_only=True)
class Status(StateMessage):
    """The answer to vm-detect --status: the state, and what happened since the start.

    counts: what happened to frames, poses and messages since the start. memory_mib [MiB]: memory of the process.
    model_sha256: SHA-256 of the model file. last: the last frame; null before the first.
    """

    counts: Annotated[Mapping[str, int], SIZE]
    memory_mib: Annotated[float, Sent(1, least=0)]
    model_sha256: Annotated[str, Sent()]
    last: Annotated[LiveFrame | None, Sent(null=True)]


KINDS = {"frame": LiveFrame, "state": StateMessage, "status": Status, "file_frame": FileFrame}
"""The kinds of messages."""


def file_message(frame: Frame, detections: Detections, emit_points: Sequence[str], explain: bool) -> Message:
    """A frame of a file or folder.

    emit_points: classes whose points are listed. explain: list rejected clusters too.
    """
    return FileFrame(
        frame=frame.index,
        source=frame.source,
        stamp=frame.stamp,
        class_points={name: detections.points_of(name) for name in emit_points} or None,
        rejected=detections.rejected if explain else None,
        **vars(results(detections)),
    ).as_dict()


def live_frame(number: int, state: str, shot: Shot, detections: Detections, now: float) -> LiveFrame:
    """A frame of a live camera; now: current monotonic time [s]."""
    return LiveFrame(
        state=state,
        frame=number,
        t=shot.captured,
        wall=shot.captured + wall_offset(),
        age_ms=1e3 * (now - shot.captured),
        latency_ms=1e3 * (now - shot.arrived),
        truth=shot.truth or None,
        **vars(results(detections)),
    )


def state_message(state: str, reason: str, **more: Any) -> Message:
    """The state of a live detector at this moment. more: the further fields of a Status."""
    kind = Status if more else StateMessage
    return kind(state=state, t=time.monotonic(), wall=time.time(), reason=reason, **more).as_dict()


def to_json_line(message: Message) -> bytes:
    """A message as one line of compact JSON (RFC 8259: no NaN)."""
    return json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"
