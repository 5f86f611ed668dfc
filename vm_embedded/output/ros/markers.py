"""Objects and features of the field as visualization_msgs/MarkerArray, which RViz and Foxglove draw."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Floats
from .detection_messages import FrameResults

_CYLINDER, _LINE_STRIP, _LINE_LIST, _SPHERE_LIST, _TEXT = 3, 4, 5, 7, 9
_ADD, _DELETE_ALL = 0, 3

_OBJECT, _LINE, _BORDER, _POST, _ROBOT = (
    *((1.0, 0.86, 0.24), (1.0, 0.0, 1.0), (0.0, 0.82, 1.0)),
    *((0.35, 0.75, 1.0), (1.0, 0.59, 0.24)),
)
"""Red, green, blue: the colors of the pictures of --save-overlay."""

_POST_HEIGHT, _ROBOT_HEIGHT, _LETTER, _STROKE = 1.2, 0.6, 0.25, 0.05  # [m], as drawn


def marker_array(frame: FrameResults) -> Any:
    """A MarkerArray of all that a frame shows. Its first marker deletes those of the frame before."""
    drawn = _Drawing(frame)
    side = 2.0 * frame.detections.manifest.object_radius
    objects = np.array([each.position for each in frame.detections]).reshape(-1, 3)
    drawn.add("objects", _SPHERE_LIST, _OBJECT, (side, side, side), objects)
    field = frame.detections.field
    if field is not None:
        for name, things, color, height in (
            ("posts", field.posts, _POST, _POST_HEIGHT),
            ("robots", field.robots, _ROBOT, _ROBOT_HEIGHT),
        ):
            for each in things:
                place = np.append(each.position, 0.5 * height)
                drawn.add(name, _CYLINDER, color, (each.width, each.width, height), at=place)
        ends = np.array([each.ends for each in field.lines]).reshape(-1, 2)
        drawn.add("lines", _LINE_LIST, _LINE, (_STROKE, 0.0, 0.0), ends)
        if field.circle is not None:
            drawn.add("circle", _LINE_STRIP, _LINE, (_STROKE, 0.0, 0.0), field.circle.outline[::3])
        for crossing in field.crossings:
            place = np.append(crossing.position, _LETTER)
            drawn.add("crossings", _TEXT, _LINE, (0.0, 0.0, _LETTER), at=place, text=crossing.kind)
        if field.border is not None:
            drawn.add("border", _LINE_STRIP, _BORDER, (_STROKE, 0.0, 0.0), field.border.points)
    return frame.types.MarkerArray(markers=drawn.markers)


class _Drawing:
    """Markers of a frame. markers: so far."""

    def __init__(self, frame: FrameResults) -> None:
        self._frame, types = frame, frame.types
        self._texture = types.CompressedImage(header=frame.on_plane, format="", data=types.octets(b""))
        self._mesh = types.MeshFile(filename="", data=types.octets(b""))
        self._forever = types.Duration(sec=0, nanosec=0)
        self._origin = types.Pose(
            position=types.Point(x=0.0, y=0.0, z=0.0), orientation=types.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
        )
        self.markers: list[Any] = []
        self.add("", 0, _LINE, (0.0, 0.0, 0.0), at=np.zeros(3), action=_DELETE_ALL)

    def add(
        self,
        name: str,
        kind: int,
        color: tuple[float, float, float],
        scale: tuple[float, float, float],
        points: Floats | None = None,
        *,
        at: Floats | None = None,
        text: str = "",
        action: int = _ADD,
    ) -> None:
        """Add a marker of points (n, 2) or (n, 3), if there are any, or one at a place (3,) [m]."""
        if points is not None and not len(points):
            return
        frame, types = self._frame, self._frame.types
        self.markers.append(
            types.Marker(
                header=frame.on_plane,
                ns=name,
                id=len(self.markers),
                type=kind,
                action=action,
                pose=self._origin if at is None else frame.pose(at),
                scale=types.Vector3(**dict(zip("xyz", map(float, scale), strict=True))),
                color=types.ColorRGBA(**dict(zip("rgb", color, strict=True)), a=1.0),
                lifetime=self._forever,
                frame_locked=False,
                points=[] if points is None else [frame.point(each) for each in points],
                colors=[],
                texture_resource="",
                texture=self._texture,
                uv_coordinates=[],
                text=text,
                mesh_resource="",
                mesh_file=self._mesh,
                mesh_use_embedded_materials=False,
            )
        )
