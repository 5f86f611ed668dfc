"""The tree of tf: transforms between frames at a time, interpolated for each joint."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...arrays import Floats
from ...errors import InputError, unknown
from ...geometry.orientation import (
    OPTICAL_TO_CAMERA,
    Orientation,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from ...poses.buffer import interpolate_rotation

_KEPT = 3.0
"""How long the transforms of a joint are kept [s]."""

_MOST = 1000
"""Largest number of joints. A node that always makes new names must not fill the memory."""


@dataclass(frozen=True, eq=False)
class Transform:
    """Maps points of a frame into its parent's: rotation (3, 3), translation (3,) [m]."""

    rotation: Floats
    translation: Floats

    @classmethod
    def identity(cls) -> Transform:
        """The transform of a frame into itself."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_message(cls, message: Any) -> Transform:
        """From a geometry_msgs/Transform or Pose. Raises GeometryError or InputError for numbers that are none."""
        place = getattr(message, "translation", None) or message.position
        turn = getattr(message, "rotation", None) or message.orientation
        translation = np.array([place.x, place.y, place.z], dtype=np.float64)
        if not np.isfinite(translation).all():
            raise InputError(f"translation must be finite numbers, not {translation.tolist()}")
        return cls(rotation_from_quaternion((turn.w, turn.x, turn.y, turn.z)), translation)

    def __matmul__(self, other: Transform) -> Transform:
        """The transform that applies `other` first."""
        return Transform(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Transform:
        """The transform back."""
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)


@dataclass
class _Joint:
    """A frame's parent, and its transforms with their times; time None: fixed."""

    parent: str
    times: deque[float] = field(default_factory=deque)
    transforms: deque[Transform] = field(default_factory=deque)
    fixed: Transform | None = None

    def at(self, time: float) -> Transform:
        """The transform at a time, interpolated; beyond the oldest or newest one, that one."""
        if self.fixed is not None:
            return self.fixed
        after = bisect_right(self.times, time)
        if after in (0, len(self.times)):
            return self.transforms[min(after, len(self.times) - 1)]
        one, other = self.transforms[after - 1], self.transforms[after]
        share = (time - self.times[after - 1]) / (self.times[after] - self.times[after - 1])
        return Transform(
            interpolate_rotation(one.rotation, other.rotation, share),
            one.translation + share * (other.translation - one.translation),
        )


class TransformTree:
    """The newest transforms of tf, by the names of their frames."""

    def __init__(self) -> None:
        self._joints: dict[str, _Joint] = {}

    def add(self, message: Any, time: float | None) -> None:
        """Add a geometry_msgs/TransformStamped. time [s]: of any one clock, or None for one of tf_static.

        It ignores a transform that is not newer than the last one of its joint. Raises GeometryError or InputError,
        also for a new joint beyond the first _MOST ones.
        """
        parent, child = _plain(message.header.frame_id), _plain(message.child_frame_id)
        transform = Transform.from_message(message.transform)
        joint = self._joints.get(child)
        if joint is None and len(self._joints) >= _MOST:
            raise InputError(f"tf has more than {_MOST} frames: {child} is ignored")
        if joint is None or joint.parent != parent or (joint.fixed is None) != (time is not None):
            joint = self._joints[child] = _Joint(parent)
        if time is None:
            joint.fixed = transform
            return
        if joint.times and time <= joint.times[-1]:
            if joint.times[-1] - time < _KEPT:
                return
            joint.times.clear()  # the clock was set back
            joint.transforms.clear()
        joint.times.append(time)
        joint.transforms.append(transform)
        while time - joint.times[0] > _KEPT:
            joint.times.popleft()
            joint.transforms.popleft()

    def newest(self, target: str, source: str) -> float:
        """Up to which time all joints between two frames are known [s]; infinite if all are fixed.

        Raises InputError if the frames are not connected.
        """
        down, up = self._path(target, source)
        return min((each.times[-1] for each in (*down, *up) if each.fixed is None), default=math.inf)

    def at(self, target: str, source: str, time: float) -> Transform:
        """The transform of points of `source` into `target` at a time [s]. Raises InputError as `newest` does."""
        down, up = self._path(target, source)
        found = Transform.identity()
        for joint in up:
            found = joint.at(time) @ found
        back = Transform.identity()
        for joint in down:
            back = joint.at(time) @ back
        return back.inverse() @ found

    def _path(self, target: str, source: str) -> tuple[list[_Joint], list[_Joint]]:
        """The joints from `target` and from `source` up to their nearest common frame."""
        ups = [list(self._up(_plain(each))) for each in (target, source)]
        names = [
            [_plain(start), *(joint.parent for joint in up)] for start, up in zip((target, source), ups, strict=True)
        ]
        for steps, name in enumerate(names[1]):
            if name in names[0]:
                return ups[0][: names[0].index(name)], ups[1][:steps]
        known = sorted({*self._joints, *(joint.parent for joint in self._joints.values())})
        for each in (target, source):
            if _plain(each) not in known:
                raise InputError(unknown("tf frame", each, known) if known else "tf has sent no transform yet")
        raise InputError(f"tf does not connect {target} and {source}")

    def _up(self, name: str) -> Iterator[_Joint]:
        seen = {name}
        while name in self._joints:
            yield self._joints[name]
            name = self._joints[name].parent
            if name in seen:
                raise InputError(f"tf has a loop through {name}")
            seen.add(name)


def _plain(frame: str) -> str:
    """The name of a frame without the slash that ROS 1 put before it."""
    return frame.lstrip("/")


def transform_message(types: Any, header: Any, camera_frame: str, orientation: Orientation) -> Any:
    """The geometry_msgs/TransformStamped of a camera above the plane; its frame has optical axes.

    header: with the frame of the plane.
    """
    w, x, y, z = quaternion_from_rotation(orientation.rotation @ OPTICAL_TO_CAMERA)
    return types.TransformStamped(
        header=header,
        child_frame_id=camera_frame,
        transform=types.Transform(
            translation=types.Vector3(x=0.0, y=0.0, z=float(orientation.height)),
            rotation=types.Quaternion(x=x, y=y, z=z, w=w),
        ),
    )
