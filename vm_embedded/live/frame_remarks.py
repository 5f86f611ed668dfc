"""What the log says once about the frames: signs of a mistake that leave the state as it is."""

from __future__ import annotations

from collections.abc import Iterator

from ..cameras.ros.lens import rectified_doubt
from ..geometry.lens_doubt import lens_doubt
from ..geometry.orientation import Orientation
from .answering import Answer
from .pose_remark import pose_remark

_PATIENCE = 5.0
"""How long frames may show no part of the plane [s]."""


_SEVERAL = 20
"""Pictures that are needed to remark on the pose."""


class FrameRemarks:
    """Looks at the first lens, at whether the plane comes into view, and at what the frames say about the pose.

    A robot may look up for a while: once it has seen the plane, there is nothing to remark. fixed: the pose of the
    configuration, if it is used for all frames.
    """

    def __init__(self, fixed: Orientation | None = None) -> None:
        self._fixed = fixed
        self._verdict = ""  # the last one that was remarked
        self._began: float | None = None  # time of the first answer [s]
        self._is_done = False  # whether the plane was seen, or missed for long enough

    def about(self, answer: Answer) -> Iterator[tuple[str, str]]:
        """An event and its reason for each remark that an answer gives rise to."""
        if self._began is None:
            self._began = answer.time
            height, width = answer.shot.image.shape[:2]
            doubt = lens_doubt(answer.lens, (width, height))
            rectified = rectified_doubt(answer.shot.topic, answer.lens)
            for each in filter(None, (doubt, rectified)):
                yield "doubtful lens", str(each)
        yield from self._about_pose(answer)
        if self._is_done:
            return
        is_seen = len(answer.detections.pixels) > 0
        self._is_done = is_seen or answer.time - self._began > _PATIENCE
        if self._is_done and not is_seen:
            yield (
                "plane not in view",
                f"no frame of the first {_PATIENCE:g} s shows a near part of the plane: check the camera's height [m], "
                "pitch (down is above 0) or poses, and lens",
            )

    def _about_pose(self, answer: Answer) -> Iterator[tuple[str, str]]:
        pose = answer.detections.pose
        if pose is None or pose.verdict == self._verdict or pose.frames < _SEVERAL:
            return
        remark = pose_remark(pose, self._fixed)
        if remark:
            self._verdict = pose.verdict
            yield f"{pose.verdict} pose", remark
