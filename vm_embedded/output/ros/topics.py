"""The topics with what a frame shows: one table for vm-ros, through rclpy or cyclonedds, and for MCAP files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .detection_messages import FrameResults, detection_2d_array, detection_3d_array
from .field_messages import (
    ball_array,
    balls_in_image,
    boundary_in_image,
    field_boundary,
    goalpost_array,
    goalpost_poses,
    goalposts_in_image,
    marking_array,
    markings_in_image,
    robot_array,
    robot_poses,
    robots_in_image,
)
from .markers import marker_array

TOPICS: dict[str, tuple[str, Callable[[FrameResults], Any | None]]] = {
    "detections_2d": ("Detection2DArray", detection_2d_array),
    "detections_3d": ("Detection3DArray", detection_3d_array),
    "balls": ("BallArray", ball_array),
    "goalposts": ("GoalpostArray", goalpost_array),
    "robots": ("RobotArray", robot_array),
    "markings": ("MarkingArray", marking_array),
    "field_boundary": ("FieldBoundary", field_boundary),
    "balls_in_image": ("BallArray2D", balls_in_image),
    "goalposts_in_image": ("GoalpostArray2D", goalposts_in_image),
    "robots_in_image": ("RobotArray2D", robots_in_image),
    "markings_in_image": ("MarkingArray2D", markings_in_image),
    "field_boundary_in_image": ("FieldBoundary2D", boundary_in_image),
    "goalpost_poses": ("PoseArray", goalpost_poses),
    "robot_poses": ("PoseArray", robot_poses),
    "markers": ("MarkerArray", marker_array),
}
"""By the last part of its name: the short name of its message, and what makes it; None where the network has none."""
