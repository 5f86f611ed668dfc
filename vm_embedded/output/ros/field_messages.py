"""Features of the field as messages of geometry_msgs and of soccer_vision, 3D on the plane and 2D in the image.

Each function returns None for a network without these features. The messages have no height: only what stands or lies
on the ground is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import islice
from typing import Any

import numpy as np

from ...arrays import Floats
from ...detection.detection import Detection
from ...field.features import Crossing, FieldFeatures, Segment, Upright
from .detection_messages import FrameResults, box_around, object_box

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

_STEP = 0.1
"""Length of a ray whose direction in the image is needed [m]."""


def rays_of(crossing: Crossing) -> list[tuple[float, float]]:
    """The directions of the lines that leave a crossing, on the plane."""
    angles = [crossing.heading + each for each in _RAYS[crossing.kind]]
    return [(math.cos(each), math.sin(each)) for each in angles]


def _of_field(make: Callable[[FrameResults, FieldFeatures], Any]) -> Callable[[FrameResults], Any | None]:
    """A function that makes a message from the features of a frame, if its network has any."""

    def made(frame: FrameResults) -> Any | None:
        return None if frame.detections.field is None else make(frame, frame.detections.field)

    return made


def ball_array(frame: FrameResults) -> Any:
    """A BallArray of the objects of class ball."""
    types = frame.types
    balls = [
        types.Ball(center=frame.point(each.position), confidence=_confidence(types, each.confidence))
        for each in _balls(frame)
    ]
    return types.BallArray(header=frame.on_plane, balls=balls)


def balls_in_image(frame: FrameResults) -> Any:
    """The same in 2D."""
    types = frame.types
    balls = [
        types.Ball2D(
            bb=object_box(types, each),
            center=_pixel(types, each.center),
            confidence=_confidence(types, each.confidence),
        )
        for each in _balls(frame)
    ]
    return types.BallArray2D(header=frame.in_image, balls=balls)


@_of_field
def goalpost_array(frame: FrameResults, field: FieldFeatures) -> Any:
    """A GoalpostArray. The posts of a whole goal have a side; nothing tells whose goal it is."""
    types = frame.types
    return types.GoalpostArray(
        header=frame.on_plane, posts=_goalposts(types, field, types.Goalpost, _boxes(frame, field.posts))
    )


@_of_field
def goalposts_in_image(frame: FrameResults, field: FieldFeatures) -> Any:
    """The same in 2D."""
    types = frame.types
    posts = _goalposts(types, field, types.Goalpost2D, _boxes_in_image(frame, field.posts))
    return types.GoalpostArray2D(header=frame.in_image, posts=posts)


def _goalposts(types: Any, field: FieldFeatures, post: Any, boxes: Sequence[Any]) -> list[Any]:
    sides = {number: side for goal in field.goals for number, side in zip(goal, (_LEFT, _RIGHT), strict=True)}
    return [
        post(
            bb=box,
            attributes=types.GoalpostAttributes(side=sides.get(number, 0), team=0),
            confidence=_confidence(types, each.confidence),
        )
        for number, (each, box) in enumerate(zip(field.posts, boxes, strict=True))
    ]


@_of_field
def robot_array(frame: FrameResults, field: FieldFeatures) -> Any:
    """A RobotArray, without attributes."""
    types, boxes = frame.types, _boxes(frame, field.robots)
    return types.RobotArray(header=frame.on_plane, robots=_robots(types, field, types.Robot, boxes))


@_of_field
def robots_in_image(frame: FrameResults, field: FieldFeatures) -> Any:
    """The same in 2D."""
    types, boxes = frame.types, _boxes_in_image(frame, field.robots)
    return types.RobotArray2D(header=frame.in_image, robots=_robots(types, field, types.Robot2D, boxes))


def _robots(types: Any, field: FieldFeatures, robot: Any, boxes: Sequence[Any]) -> list[Any]:
    return [
        robot(
            bb=box,
            attributes=types.RobotAttributes(player_number=0, team=0, state=0, facing=0),
            confidence=_confidence(types, each.confidence),
        )
        for each, box in zip(field.robots, boxes, strict=True)
    ]


@_of_field
def marking_array(frame: FrameResults, field: FieldFeatures) -> Any:
    """A MarkingArray of the lines, the center circle and the crossings."""
    types = frame.types
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
        intersections=[
            types.MarkingIntersection(
                center=frame.point(each.position),
                num_rays=len(_RAYS[each.kind]),
                rays=[types.Vector3(x=x, y=y, z=0.0) for x, y in rays_of(each)],
                confidence=_confidence(types, each.confidence),
            )
            for each in field.crossings
        ],
        segments=[
            types.MarkingSegment(
                **dict(zip(("start", "end"), frame.points(each.ends), strict=True)),
                confidence=_confidence(types, each.confidence),
            )
            for each in field.lines
        ],
    )


@_of_field
def markings_in_image(frame: FrameResults, field: FieldFeatures) -> Any:
    """The same in 2D, of lines with both ends in the image; the ellipse is around the visible part of the circle."""
    types = frame.types
    return types.MarkingArray2D(
        header=frame.in_image,
        ellipses=_ellipses_in_image(frame, field),
        intersections=_intersections_in_image(frame, field),
        segments=[
            types.MarkingSegment2D(
                start=_pixel(types, start), end=_pixel(types, end), confidence=_confidence(types, each.confidence)
            )
            for each, (start, end) in zip(field.lines, _ends(field.lines), strict=True)
            if not math.isnan(sum(start) + sum(end))
        ],
    )


def _ends(lines: Sequence[Segment]) -> list[list[list[float]]]:
    """The pixels of the two ends of each line."""
    found: list[list[list[float]]] = np.array([each.pixels for each in lines]).reshape(-1, 2, 2).tolist()
    return found


def _ellipses_in_image(frame: FrameResults, field: FieldFeatures) -> list[Any]:
    types, view, circle = frame.types, frame.detections.observation.view, field.circle
    if circle is None:
        return []
    center, *outline = view.plane_pixels(np.vstack([circle.center, circle.outline]))
    pixels = np.array(outline)[view.in_picture(np.array(outline))]
    if not len(pixels) or np.isnan(center).any():
        return []
    bb, confidence = box_around(types, pixels), _confidence(types, circle.confidence)
    return [types.MarkingEllipse2D(bb=bb, center=_pixel(types, center), confidence=confidence)]


def _intersections_in_image(frame: FrameResults, field: FieldFeatures) -> list[Any]:
    """MarkingIntersections that the lens sees; their headings are from 0 to 2 pi [rad], and ascend."""
    types, crossings = frame.types, field.crossings
    directions, places = [rays_of(each) for each in crossings], []
    for each, rays in zip(crossings, directions, strict=True):
        x, y = each.position.tolist()
        places += [(x, y), *((x + _STEP * east, y + _STEP * north) for east, north in rays)]
    pixels = iter(_pixels_of(frame, np.array(places).reshape(-1, 2)).tolist())
    made = []
    for each, rays in zip(crossings, directions, strict=True):
        center, *ends = islice(pixels, 1 + len(rays))
        if math.isnan(sum(center)):
            continue
        headings = [math.atan2(y - center[1], x - center[0]) % math.tau for x, y in ends if not math.isnan(x)]
        made.append(
            types.MarkingIntersection2D(
                center=_pixel(types, center),
                num_rays=len(ends),
                heading_rays=types.doubles(sorted(headings) if len(headings) == len(ends) else []),  # all or none
                confidence=_confidence(types, each.confidence),
            )
        )
    return made


@_of_field
def field_boundary(frame: FrameResults, field: FieldFeatures) -> Any:
    """A FieldBoundary: the visible border from right to left, without points if the picture shows none."""
    points = [] if field.border is None else frame.points(field.border.points)
    unknown = _confidence(frame.types, _UNKNOWN)
    return frame.types.FieldBoundary(header=frame.on_plane, points=points, confidence=unknown)


@_of_field
def boundary_in_image(frame: FrameResults, field: FieldFeatures) -> Any:
    """The same in 2D, without what the lens does not see."""
    pixels = np.empty((0, 2)) if field.border is None else field.border.pixels
    points = [_pixel(frame.types, each) for each in pixels if not np.isnan(each).any()]
    unknown = _confidence(frame.types, _UNKNOWN)
    return frame.types.FieldBoundary2D(header=frame.in_image, points=points, confidence=unknown)


@_of_field
def goalpost_poses(frame: FrameResults, field: FieldFeatures) -> Any:
    """A PoseArray of the feet of the goal posts."""
    return _poses(frame, field.posts)


@_of_field
def robot_poses(frame: FrameResults, field: FieldFeatures) -> Any:
    """A PoseArray of the feet of the robots."""
    return _poses(frame, field.robots)


def _poses(frame: FrameResults, uprights: Sequence[Upright]) -> Any:
    return frame.types.PoseArray(header=frame.on_plane, poses=[frame.pose(each.position) for each in uprights])


def _balls(frame: FrameResults) -> list[Detection]:
    return [each for each in frame.detections if each.class_name == "ball"]


def _boxes(frame: FrameResults, uprights: Sequence[Upright]) -> list[Any]:
    """BoundingBox3D of feet: as wide as they are seen, and flat."""
    types = frame.types
    return [
        types.BoundingBox3D(
            center=frame.pose(each.position),
            size=types.Vector3(x=float(each.width), y=float(each.width), z=0.0),
        )
        for each in uprights
    ]


def _boxes_in_image(frame: FrameResults, uprights: Sequence[Upright]) -> list[Any]:
    """BoundingBox2D of feet: as wide as they are seen, and flat."""
    types = frame.types
    feet = np.array([each.position for each in uprights]).reshape(-1, 2)
    half = 0.5 * np.array([each.width for each in uprights]) / np.hypot(*feet.T)
    across = half[:, None] * feet[:, ::-1] * (-1.0, 1.0)
    left, right = _pixels_of(frame, np.concatenate([feet + across, feet - across])).reshape(2, -1, 2)
    widths = np.hypot(*(left - right).T).tolist()
    return [
        types.BoundingBox2D(
            center=types.Pose2D(position=_pixel(types, each.pixel), theta=0.0), size_x=width, size_y=0.0
        )
        for each, width in zip(uprights, widths, strict=True)
    ]


def _pixels_of(frame: FrameResults, places: Floats) -> Floats:
    """Pixels (n, 2) of places (n, 2) [m] on the plane, from below the camera."""
    return frame.detections.observation.view.plane_pixels(places)


def _pixel(types: Any, pixel: Iterable[float]) -> Any:
    """A vision_msgs/Point2D."""
    x, y = pixel
    return types.Point2D(x=float(x), y=float(y))


def _confidence(types: Any, confidence: float) -> Any:
    return types.Confidence(confidence=float(confidence))
