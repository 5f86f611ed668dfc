"""The JSON Schema of all messages that vm-detect prints and sends; docs/messages.schema.json holds it as a file.

It is strict: messages have no other fields. The tests validate every message against it.
"""

from __future__ import annotations

from typing import Any

from .messages import STATES

Schema = dict[str, Any]


def message_schema() -> Schema:
    """The schema, JSON Schema 2020-12. A message is one of the kinds in `oneOf`; `$defs` holds their parts."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Messages of vm-detect",
        "description": "Lengths are in meters, angles in radians, pixels as x and y. Positions are in the frame of the "
        "observation plane: its origin is below the camera, z points up.",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in _MESSAGES],
        "$defs": {**_MESSAGES, **_PARTS},
    }


def _number(about: str, **limits: Any) -> Schema:
    return {"type": "number", "description": about, **limits}


def _size(about: str) -> Schema:
    return _number(about, minimum=0)


def _share(about: str) -> Schema:
    return _number(about, minimum=0, maximum=1)


def _whole(about: str, least: int = 0) -> Schema:
    return {"type": "integer", "description": about, "minimum": least}


def _text(about: str) -> Schema:
    return {"type": "string", "description": about}


def _vector(length: int, about: str) -> Schema:
    return {
        "type": "array",
        "description": about,
        "items": {"type": "number"},
        "minItems": length,
        "maxItems": length,
    }


def _pixel(about: str) -> Schema:
    return _vector(2, f"{about}; null outside of the picture") | {"items": {"type": ["number", "null"]}}


def _list(of: Schema, about: str, **limits: int) -> Schema:
    return {"type": "array", "description": about, "items": of, **limits}


def _part(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _parts(name: str, about: str) -> Schema:
    return _list(_part(name), about)


def _or_null(schema: Schema) -> Schema:
    return {"anyOf": [schema, {"type": "null"}]}


def _object(about: str, required: Schema, optional: Schema | None = None) -> Schema:
    return {
        "type": "object",
        "description": about,
        "properties": {**required, **(optional or {})},
        "required": list(required),
        "additionalProperties": False,
    }


_STAGES = ("mesh", "project", "sample", "infer", "propose", "look", "cluster", "field", "track", "total")

_CONFIDENCE = {"confidence": _share("mean probability of its points")}

_FRAME = {
    "points": _whole("number of mesh points on screen"),
    "detections": _parts("detection", "the objects, most confident first"),
    "timing_ms": {
        "type": "object",
        "description": "time of each stage and of the whole call [ms]",
        "properties": {name: {"type": "number", "minimum": 0} for name in _STAGES},
        "required": ["total"],
        "additionalProperties": False,
    },
}
_FIELD = {"field": _part("field")}

_TIMES = {
    "t": _number("time on the monotonic clock [s]: of capture in a frame, of the message in a state"),
    "wall": _number("the same time since 1970 [s]"),
}

_STATE = {
    "type": {"const": "state"},
    "state": {"enum": list(STATES), "description": "state of the detector"},
    **_TIMES,
    "reason": _text("why the detector is in this state; it may be empty"),
}

_XYZ = _object("a geometry_msgs/Point", {name: _number("[m]") for name in "xyz"})

_MESSAGES: dict[str, Schema] = {
    "frame": _object(
        "a frame of a live camera",
        {
            "type": {"const": "frame"},
            "state": _STATE["state"],
            "frame": _whole("number of the frame, from 1", 1),
            **_TIMES,
            "age_ms": _number("time from capture to the message [ms]"),
            "latency_ms": _number("time from the frame's arrival to the message [ms]"),
            **_FRAME,
        },
        _FIELD | {"truth": {"type": "object", "description": "what a synthetic camera knows about its scene"}},
    ),
    "state": _object("a state of a live detector, without detections", _STATE),
    "status": _object(
        "the answer to vm-detect --status: the state, and what happened since the start",
        {
            **_STATE,
            "counts": {
                "type": "object",
                "description": "what happened to frames, poses and messages since the start",
                "additionalProperties": {"type": "integer", "minimum": 0},
            },
            "memory_mib": _size("memory of the process [MiB]"),
            "model_sha256": _text("SHA-256 of the model file"),
            "last": _or_null(_part("frame")) | {"description": "the last frame; null before the first"},
        },
    ),
    "file_frame": _object(
        "a frame of a file or folder",
        {
            "frame": _whole("number of the frame, from 0"),
            "source": _text("name of the file"),
            "stamp": _or_null(_number("time in a video or recording [s]")) | {"description": "null for an image"},
            **_FRAME,
        },
        _FIELD
        | {
            "class_points": {
                "type": "object",
                "description": "points of the classes of --emit-points, by name",
                "additionalProperties": _part("class_points"),
            },
            "rejected": _parts("detection", "rejected proposals or clusters, each with its reason; with --explain"),
        },
    ),
    "ros_state": _object(
        'a state with [output] format = "ros", without detections',
        {
            "state": _STATE["state"],
            "reason": _STATE["reason"],
            "header": _part("ros_header") | {"description": "with the time of the message"},
        },
    ),
    "ros": _object(
        'a frame with [output] format = "ros": names and types of ROS 2, and the state',
        {
            "state": _STATE["state"],
            "detections": _object(
                "a vision_msgs/Detection2DArray",
                {"header": _part("ros_header"), "detections": _parts("ros_detection", "the objects")},
            ),
            "points": _list(
                _object("a geometry_msgs/PointStamped", {"header": _part("ros_header"), "point": _XYZ}),
                "the position of each object",
            ),
        },
    ),
}
"""The kinds of messages."""

_PARTS: dict[str, Schema] = {
    "detection": _object(
        "an object on the observation plane",
        {
            "class": _text("name of its class"),
            "confidence": _share("0 to 1"),
            "center": _vector(2, "center in the image [px]"),
            "radius": _size("radius in the image [px]"),
            "bearing": _vector(3, "unit vector from the camera to its center"),
            "position": _vector(3, "its center [m]"),
            "distance": _size("from the camera to its center [m]"),
            "angular_radius": _size("angle from its center to its outline [rad]"),
            "distance_by_angle": _size("distance that follows from angular_radius [m]"),
            "distances_agree": {"type": "boolean", "description": "whether the two distances agree"},
            "points": _whole("number of mesh points inside its outline"),
        },
        {"reason": _text("why it was rejected"), "track": _part("track")},
    ),
    "track": _object(
        "the same object over several frames; with --track",
        {
            "id": _whole("its number", 1),
            "position": _vector(3, "smoothed position of its center [m]"),
            "velocity": _vector(2, "velocity on the plane, x and y [m/s]"),
            "position_error": _size("standard deviation of the position where it is largest [m]"),
            "velocity_error": _size("standard deviation of the velocity where it is largest [m/s]"),
        },
    ),
    "class_points": _object(
        "the points of a class",
        {
            "bearings": _list(_vector(3, "unit vector from the camera"), "one per point"),
            "probabilities": _list(_share("of the class"), "one per point"),
        },
    ),
    "field": _object(
        "features of the field; only with a network that knows them",
        {
            "posts": _parts("upright", "goal posts, nearest first"),
            "goals": _list(
                _list(_whole("index in posts"), "left post, right post", minItems=2, maxItems=2),
                "pairs of posts that form a goal",
            ),
            "robots": _parts("upright", "robots and other obstacles, nearest first"),
            "lines": _parts("line", "straight pieces of the field lines, longest first"),
            "circle": _or_null(_part("circle")),
            "crossings": _parts("crossing", "where two lines meet at a right angle"),
            "border": _or_null(_part("border")),
        },
    ),
    "upright": _object(
        "a goal post or a robot",
        {
            "class": _text("post or robot"),
            "confidence": _share("probability of the close look at its base; without one, mean of its points"),
            "position": _vector(2, "its base on the plane [m]"),
            "distance": _size("from the camera to its base [m]"),
            "bearing": _vector(3, "unit vector from the camera to its base"),
            "pixel": _pixel("its base in the image [px]"),
            "width": _size("as seen from the camera [m]"),
        },
    ),
    "line": _object(
        "a straight piece of a field line",
        {
            "ends": _list(_vector(2, "[m]"), "both ends on the plane", minItems=2, maxItems=2),
            "pixels": _list(_pixel("[px]"), "both ends in the image", minItems=2, maxItems=2),
            **_CONFIDENCE,
        },
    ),
    "circle": _object(
        "the center circle",
        {
            "center": _vector(2, "on the plane [m]"),
            "radius": _size("of the middle of its line [m]"),
            "arc": _size("how much of it is visible [rad]"),
            **_CONFIDENCE,
        },
    ),
    "crossing": _object(
        "where two lines meet at a right angle",
        {
            "kind": {"enum": ["L", "T", "X"]},
            "position": _vector(2, "on the plane [m]"),
            "heading": _number("counterclockwise from the x axis [rad]"),
            "confidence": _share("product of those of its lines, less if one ends in front of it"),
        },
    ),
    "border": _object(
        "the visible border of the field, from right to left",
        {
            "points": _list(_vector(2, "[m]"), "on the plane"),
            "pixels": _list(_pixel("[px]"), "the same points in the image"),
        },
    ),
    "ros_header": _object(
        "a std_msgs/Header",
        {
            "stamp": _object(
                "time since 1970",
                {"sec": _whole("[s]"), "nanosec": _whole("[ns]") | {"maximum": 999_999_999}},
            ),
            "frame_id": _text("[output] frame_id"),
        },
    ),
    "ros_detection": _object(
        "a vision_msgs/Detection2D",
        {
            "header": _part("ros_header"),
            "id": _text("number of its track; empty without --track"),
            "results": _list(
                _object(
                    "a vision_msgs/ObjectHypothesisWithPose",
                    {
                        "hypothesis": _object(
                            "a vision_msgs/ObjectHypothesis",
                            {"class_id": _text("name of its class"), "score": _share("confidence")},
                        ),
                        "pose": _object(
                            "a geometry_msgs/PoseWithCovariance",
                            {
                                "pose": _object(
                                    "a geometry_msgs/Pose",
                                    {
                                        "position": _XYZ,
                                        "orientation": _object("no turn", {name: _number("") for name in "xyzw"}),
                                    },
                                ),
                                "covariance": _vector(36, "zeros: not known"),
                            },
                        ),
                    },
                ),
                "one",
            ),
            "bbox": _object(
                "a vision_msgs/BoundingBox2D",
                {
                    "center": _object(
                        "a vision_msgs/Pose2D",
                        {
                            "position": _object("[px]", {name: _number("[px]") for name in "xy"}),
                            "theta": _number("0"),
                        },
                    ),
                    "size_x": _size("[px]"),
                    "size_y": _size("[px]"),
                },
            ),
        },
    ),
}
"""What messages are made of."""
