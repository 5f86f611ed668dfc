"""The binary form of messages: a header of 64 bytes, then arrays of records, little-endian.

docs/daemon.md lists the layout, with a reader. Numbers have the digits of the JSON form, in single precision; the times
`t` and `wall` are in double precision. A header is followed by the records of each kind in the order of RECORDS, and by
a text: the names of the frame's classes, one per line, or the reason of a state.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from .messages import STATES, Message

VERSION = 3
"""Second field of the header. Any change of the layout changes it."""

HEADER = struct.Struct("<I4B2d2I3f10H")
"""Length of the rest, version, kind (0: state, 1: frame), state, whether there are features of the field (0 or 1), t,
wall, frame, points, age_ms, latency_ms, total time [ms], the number of records of each kind, bytes of the text, 0."""

_UPRIGHT = "class:<u4 confidence:<f4 position:(2,)<f4 distance:<f4 bearing:(3,)<f4 pixel:(2,)<f4 width:<f4"

_FIELDS = {
    "detections": "class:<u4 confidence:<f4 position:(3,)<f4 distance:<f4 bearing:(3,)<f4 center:(2,)<f4 radius:<f4 "
    "angular_radius:<f4 distance_by_angle:<f4 distances_agree:<u4 points:<u4 track:<u4 track_position:(3,)<f4 "
    "track_velocity:(2,)<f4 track_position_error:<f4 track_velocity_error:<f4",
    "posts": _UPRIGHT,
    "goals": "left:<u4 right:<u4",
    "robots": _UPRIGHT,
    "lines": "ends:(2,2)<f4 pixels:(2,2)<f4 confidence:<f4",
    "circle": "center:(2,)<f4 radius:<f4 arc:<f4 confidence:<f4",
    "crossings": "kind:<u4 position:(2,)<f4 heading:<f4 confidence:<f4",
    "border": "point:(2,)<f4 pixel:(2,)<f4",
}

RECORDS = {name: np.dtype([tuple(each.split(":")) for each in text.split()]) for name, text in _FIELDS.items()}
"""The fields of each kind of record, with the names of the JSON form. class: line of the text, from 0. left, right:
indices in posts, from 0. kind of a crossing: the code of the letter L, T or X. circle: one record or none. border: one
record per point. track: its id; 0, and NaN in the fields after it, for an object without a track."""

_NO_TRACK: Mapping[str, Any] = {
    "id": 0,
    "position": [math.nan] * 3,
    "velocity": [math.nan] * 2,
    "position_error": math.nan,
    "velocity_error": math.nan,
}

_MOST = 0xFFFF
"""Most records of a kind, and most bytes of the text: their numbers have two bytes."""


def to_binary(message: Message) -> bytes:
    """A message of a live detector in the binary form. `truth` and the time of each stage are left out."""
    field = message.get("field") or {}
    codes: dict[str, int] = {}
    records = [
        _records(RECORDS["detections"], map(_with_track_fields, message.get("detections", ())), codes),
        _records(RECORDS["posts"], field.get("posts", ()), codes),
        np.array([tuple(each) for each in field.get("goals", ())], RECORDS["goals"]),
        _records(RECORDS["robots"], field.get("robots", ()), codes),
        _records(RECORDS["lines"], field.get("lines", ()), codes),
        _records(RECORDS["circle"], filter(None, [field.get("circle")]), codes),
        _records(RECORDS["crossings"], field.get("crossings", ()), codes),
        _border_records(field.get("border")),
    ]
    records = [each[:_MOST] for each in records]
    # Cut between characters: half of one would make the whole text unreadable.
    text = message.get("reason", "\n".join(codes)).encode()[:_MOST].decode(errors="ignore").encode()
    body = b"".join([*(each.tobytes() for each in records), text])
    header = HEADER.pack(
        HEADER.size - 4 + len(body),
        VERSION,
        message["type"] == "frame",
        STATES.index(message["state"]),
        "field" in message,
        message["t"],
        message["wall"],
        message.get("frame", 0) & 0xFFFFFFFF,
        message.get("points", 0),
        message.get("age_ms", 0.0),
        message.get("latency_ms", 0.0),
        message.get("timing_ms", {}).get("total", 0.0),
        *map(len, records),
        len(text),
        0,
    )
    return header + body


def _records(
    dtype: np.dtype[np.void], values: Iterable[Mapping[str, Any]], codes: dict[str, int]
) -> npt.NDArray[np.void]:
    """The records of these dictionaries. codes: number of each class name; it gets the new ones."""

    def code(name: str, value: Any) -> Any:
        if name == "class":
            return codes.setdefault(value, len(codes))
        return ord(value) if name == "kind" else value

    names = dtype.names or ()
    return np.array([tuple(code(name, each[name]) for name in names) for each in values], dtype)


def _with_track_fields(detection: Mapping[str, Any]) -> Mapping[str, Any]:
    """A detection whose track is in fields of its own."""
    track = detection.get("track", _NO_TRACK)
    return {**detection, "track": track["id"], **{f"track_{name}": track[name] for name in _NO_TRACK}}


def _border_records(border: Mapping[str, Any] | None) -> npt.NDArray[np.void]:
    """The points of a border, or no records without one."""
    pairs = [] if border is None else list(zip(border["points"], border["pixels"], strict=True))
    return np.array(pairs, RECORDS["border"])
