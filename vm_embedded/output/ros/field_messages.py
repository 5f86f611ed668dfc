"""Features of the field as messages of soccer_vision_3d_msgs and geometry_msgs, in the frame of the plane.

Each function returns None for a network without these features. The messages have no height: only what stands or lies
on the ground is measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ...field.features import Crossing, Upright
from .detection_messages import FrameResults

_LEFT, _RIGHT = 1, 2
"""Sides of a post, for who looks into the goal."""

_RAYS = {
    "L": (-math.pi / 4.0, math.pi / 4.0),
    "T": (0.0, -math.pi / 2.0, math.pi / 2.0),
    "X": (0.0, math.pi / 2.0, math.pi, -math.pi / 2.0),
}
"""Directions [rad] of the lines that leave a crossing, from its heading."""

_UNKNOWN = -1.0
"""A confidence that is not known."""


def ball_array(frame: FrameResults) -> Any:
    """A BallArray of the objects of class ball."""
    types = frame.types
    balls = [
        types.Ball(center=frame.point(each.position), confidence=_confidence(types, each.confidence))
        for each in frame.detections
        if each.class_name == "ball"
    ]
    return types.BallArray(header=frame.on_plane, balls=balls)


def goalpost_array(frame: FrameResults) -> Any | None:
    """A GoalpostArray. The posts of a whole goal have a side; nothing tells whose goal it is."""
    field, types = frame.detections.field, frame.types
    if field is None:
        return None
    sides = {post: side for goal in field.goals for post, side in zip(goal, (_LEFT, _RIGHT), strict=True)}
    posts = [
        types.Goalpost(
            bb=_box(frame, each),
            attributes=types.GoalpostAttributes(side=sides.get(number, 0), team=0),
            confidence=_confidence(types, each.confidence),
        )
        for number, each in enumerate(field.posts)
    ]
    return types.GoalpostArray(header=frame.on_plane, posts=posts)


def robot_array(frame: FrameResults) -> Any | None:
    """A RobotArray, without attributes."""
    field, types = frame.detections.field, frame.types
    if field is None:
        return None
    robots = [
        types.Robot(
            bb=_box(frame, each),
            attributes=types.RobotAttributes(player_number=0, team=0, state=0, facing=0),
            confidence=_confidence(types, each.confidence),
        )
        for each in field.robots
    ]
    return types.RobotArray(header=frame.on_plane, robots=robots)


def marking_array(frame: FrameResults) -> Any | None:
    """A MarkingArray of the lines, the center circle and the crossings."""
    field, types = frame.detections.field, frame.types
    if field is None:
        return None
    circles = [] if field.circle is None else [field.circle]
    return types.MarkingArray(
        header=frame.on_plane,
        ellipses=[
            types.MarkingEllipse(
                diameter=2.0 * float(each.radius),
                center=frame.pose(each.center),
                confidence=_confidence(types, each.confidence),
            )
            for each in circles
        ],
        intersections=[_intersection(frame, each) for each in field.crossings],
        segments=[
            types.MarkingSegment(
                start=frame.point(each.ends[0]),
                end=frame.point(each.ends[1]),
                confidence=_confidence(types, each.confidence),
            )
            for each in field.lines
        ],
    )


def field_boundary(frame: FrameResults) -> Any | None:
    """A FieldBoundary: the visible border from right to left, without points if the picture shows none."""
    field, types = frame.detections.field, frame.types
    if field is None:
        return None
    points = [] if field.border is None else [frame.point(each) for each in field.border.points]
    return types.FieldBoundary(header=frame.on_plane, points=points, confidence=_confidence(types, _UNKNOWN))


def goalpost_poses(frame: FrameResults) -> Any | None:
    """A PoseArray of the feet of the goal posts."""
    return None if frame.detections.field is None else _poses(frame, frame.detections.field.posts)


def robot_poses(frame: FrameResults) -> Any | None:
    """A PoseArray of the feet of the robots."""
    return None if frame.detections.field is None else _poses(frame, frame.detections.field.robots)


def _poses(frame: FrameResults, uprights: Sequence[Upright]) -> Any:
    return frame.types.PoseArray(header=frame.on_plane, poses=[frame.pose(each.position) for each in uprights])


def _box(frame: FrameResults, upright: Upright) -> Any:
    """A BoundingBox3D of a foot: as wide as it is seen, and flat."""
    width = float(upright.width)
    size = frame.types.Vector3(x=width, y=width, z=0.0)
    return frame.types.BoundingBox3D(center=frame.pose(upright.position), size=size)


def _intersection(frame: FrameResults, crossing: Crossing) -> Any:
    types = frame.types
    angles = [crossing.heading + each for each in _RAYS[crossing.kind]]
    return types.MarkingIntersection(
        center=frame.point(crossing.position),
        num_rays=len(angles),
        rays=[types.Vector3(x=math.cos(each), y=math.sin(each), z=0.0) for each in angles],
        confidence=_confidence(types, crossing.confidence),
    )


def _confidence(types: Any, confidence: float) -> Any:
    return types.Confidence(confidence=float(confidence))
