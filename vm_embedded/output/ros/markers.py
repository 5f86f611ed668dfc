"""Objects and features of the field as visualization_msgs/MarkerArray, which RViz and Foxglove draw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...arrays import Floats
from ...field.features import Crossing
from .detection_messages import FrameResults
from .field_messages import rays_of

_LINE_STRIP, _LINE_LIST, _CUBE_LIST, _SPHERE_LIST = 4, 5, 6, 7
_ADD, _DELETE_ALL = 0, 3

_OBJECT, _LINE, _CROSSING, _BORDER, _POST, _ROBOT = (
    *((1.0, 0.86, 0.24), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0)),
    *((0.0, 0.82, 1.0), (0.35, 0.75, 1.0), (1.0, 0.59, 0.24)),
)
"""Red, green, blue: the colors of the pictures of --save-overlay, and white."""

_POST_HEIGHT, _ROBOT_SIZE, _RAY, _STROKE = 1.2, (0.3, 0.3, 0.6), 0.25, 0.05  # [m], as drawn


def marker_array(frame: FrameResults) -> Any:
    """A MarkerArray of all that a frame shows, with one marker for each kind of thing: markers have many fields.

    Its first marker deletes those of the frame before.
    """
    drawn = _Drawing(frame)
    side = 2.0 * frame.detections.manifest.object_radius
    drawn.add("objects", _SPHERE_LIST, _OBJECT, (side, side, side), _places(frame.detections, 3))
    field = frame.detections.field
    if field is not None:
        posts, robots = _places(field.posts), _places(field.robots)
        standing = np.repeat(_raised(posts, 0.0), 2, axis=0)
        standing[1::2, 2] = _POST_HEIGHT
        drawn.add("posts", _LINE_LIST, _POST, (2.0 * _STROKE, 0.0, 0.0), standing)
        drawn.add("robots", _CUBE_LIST, _ROBOT, _ROBOT_SIZE, _raised(robots, 0.5 * _ROBOT_SIZE[2]))
        stroke = (_STROKE, 0.0, 0.0)
        drawn.add("lines", _LINE_LIST, _LINE, stroke, np.array([each.ends for each in field.lines]).reshape(-1, 2))
        if field.circle is not None:
            drawn.add("circle", _LINE_STRIP, _LINE, stroke, field.circle.outline[::6])
        drawn.add("crossings", _LINE_LIST, _CROSSING, stroke, _rays(field.crossings))
        if field.border is not None:
            drawn.add("border", _LINE_STRIP, _BORDER, stroke, field.border.points)
    return frame.types.MarkerArray(markers=drawn.markers)


def _places(things: Any, width: int = 2) -> Floats:
    return np.array([each.position for each in things]).reshape(-1, width)


def _raised(places: Floats, height: float) -> Floats:
    """Places (n, 3) above others (n, 2) on the plane [m]."""
    return np.column_stack([places, np.full(len(places), height)])


def _rays(crossings: Sequence[Crossing]) -> Floats:
    ends = []
    for each in crossings:
        x, y = each.position.tolist()
        ends += [end for east, north in rays_of(each) for end in ((x, y), (x + _RAY * east, y + _RAY * north))]
    return np.array(ends).reshape(-1, 2)


class _Drawing:
    """Markers of a frame. markers: so far."""

    def __init__(self, frame: FrameResults) -> None:
        types = frame.types
        self._frame = frame
        self._common = {
            "header": frame.on_plane,
            "id": 0,
            "pose": types.Pose(
                position=types.Point(x=0.0, y=0.0, z=0.0), orientation=types.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
            ),
            "lifetime": types.Duration(sec=0, nanosec=0),
            "frame_locked": False,
            "colors": [],
            "texture_resource": "",
            "texture": types.CompressedImage(header=frame.on_plane, format="", data=types.octets(b"")),
            "uv_coordinates": [],
            "text": "",
            "mesh_resource": "",
            "mesh_file": types.MeshFile(filename="", data=types.octets(b"")),
            "mesh_use_embedded_materials": False,
        }
        self.markers = [self._marker("", 0, _DELETE_ALL, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), [])]

    def _marker(
        self,
        name: str,
        kind: int,
        action: int,
        color: tuple[float, float, float, float],
        scale: tuple[float, float, float],
        points: list[Any],
    ) -> Any:
        types, (red, green, blue, alpha), (x, y, z) = self._frame.types, color, scale
        return types.Marker(
            **self._common,
            ns=name,
            type=kind,
            action=action,
            scale=types.Vector3(x=x, y=y, z=z),
            color=types.ColorRGBA(r=red, g=green, b=blue, a=alpha),
            points=points,
        )

    def add(
        self,
        name: str,
        kind: int,
        color: tuple[float, float, float],
        scale: tuple[float, float, float],
        points: Floats,
    ) -> None:
        """Add a marker of points (n, 2) or (n, 3) [m], if there are any."""
        if len(points):
            self.markers.append(self._marker(name, kind, _ADD, (*color, 1.0), scale, self._frame.points(points)))
