"""Answer one shot: find its lens and orientation, and detect the objects in it."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

import cv2

from ..cameras.camera import Shot
from ..detection.detections import Detections
from ..detection.detector import Detector
from ..detection.pose_check import PoseCheck
from ..detection.tracker import Tracker
from ..errors import InputError, VisualMeshError, one_line
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from ..poses.buffer import StalePoseError
from ..poses.stream import PoseStream
from .configuration import Configuration
from .counters import Counters
from .frame_watchdog import FrameWatchdog
from .health import Health

_EVERY = 3
"""Only each third frame tells about the pose."""


@dataclass(frozen=True, eq=False)
class Answer:
    """The detections of a shot, and the lens and orientation they were computed with. time: monotonic [s]."""

    shot: Shot
    lens: Lens
    orientation: Orientation
    detections: Detections
    time: float


class Answerer:
    """Answers shots with the current configuration, and counts the outcomes."""

    def __init__(
        self,
        configuration: Configuration,
        detector: Detector,
        poses: PoseStream,
        counters: Counters,
        health: Health,
        watchdog: FrameWatchdog,
    ) -> None:
        self.configuration, self.detector = configuration, detector
        self._poses, self._counters, self._health, self._watchdog = poses, counters, health, watchdog
        self._tracker = Tracker(configuration.track)
        self.pose_check = PoseCheck(_EVERY, configuration.pose.correct)

    def reload(self, configuration: Configuration, detector: Detector) -> None:
        """Use another configuration and its detector from now on. Tracks continue; the pose is checked anew."""
        self.configuration, self.detector = configuration, detector
        self.pose_check = PoseCheck(_EVERY, configuration.pose.correct)
        self._tracker.settings = configuration.track

    async def answer(self, shot: Shot) -> Answer | None:
        """Detect the objects in a shot; None if it is too old, has no pose, or the detection fails."""
        if self._refuse_late(shot):
            return None
        try:
            lens, given = self._lens(shot), await self._orientation(shot)
            orientation = self.pose_check.corrected(given)
            self._health.pose_trouble = ""
            started = time.perf_counter()
            with self._watchdog.frame():
                detections = self.pose_check.update(self.detector.detect(shot.image, orientation, lens))
            if self.configuration.track.on:
                detections = self._tracker.update(detections, shot.captured)
        except StalePoseError as error:
            self._counters.outcomes.stale += 1
            rejection = self._poses.rejection
            self._health.pose_trouble = f"{error}; {rejection}" if rejection else str(error)
            return None
        except (VisualMeshError, cv2.error, ValueError) as error:
            # NumPy raises ValueError for arrays that do not fit. No frame may end the daemon.
            self._counters.outcomes.failed += 1
            self._health.add_trouble(time.monotonic(), one_line(error))
            return None
        took = time.perf_counter() - started
        if self._refuse_late(shot, took):
            return None
        self._report_height(orientation, detections)
        now = time.monotonic()
        self._health.add_answer(now, now - shot.arrived)
        self._counters.add_answer(detections, took, now - shot.captured)
        return Answer(shot, lens, orientation, detections, now)

    def prepare(self, answer: Answer) -> None:
        """Prepare for the orientations beside an answer's, one bucket each time. It takes a few milliseconds."""
        height, width = answer.shot.image.shape[:2]
        self.detector.prepare_nearby(answer.orientation, answer.lens, (width, height))

    def _refuse_late(self, shot: Shot, took: float = 0.0) -> bool:
        """Count and report a shot that is too old. Return whether it is. took: time of its detection so far [s]."""
        age, limit = time.monotonic() - shot.captured, self.configuration.camera.max_age_ms
        if age <= 1e-3 * limit:
            return False
        self._counters.outcomes.late += 1
        reason = f"frame is {1e3 * age:.0f} ms old, allowed are {limit:g} ms"
        if took > 0.5 * age:
            reason += f"; its detection took {1e3 * took:.0f} ms: use a faster network or a lower max_distance"
        self._health.add_trouble(time.monotonic(), reason)
        return True

    def _report_height(self, orientation: Orientation, detections: Detections) -> None:
        """Report a height that keeps the whole mesh out of view."""
        reach = self.detector.manifest.max_distance
        if not len(detections.pixels) and orientation.height > reach:
            self._health.add_trouble(
                time.monotonic(),
                f"the camera's height is {orientation.height:g} m, but the mesh ends at a distance of {reach:g} m: "
                "heights are in meters",
            )

    def _lens(self, shot: Shot) -> Lens:
        """The shot's own lens, or the configured one. Raises InputError."""
        lens = shot.lens or self.configuration.lens_for((shot.image.shape[1], shot.image.shape[0]))
        if lens is None:
            raise InputError("no lens: give --lens or --fov")
        return lens

    async def _orientation(self, shot: Shot) -> Orientation:
        """The camera's orientation when the shot was taken. It waits up to wait_ms for a pose as new as the shot.

        Raises StalePoseError or InputError.
        """
        settings = self.configuration.pose
        if settings.source == "fixed":
            fixed = shot.orientation or self.configuration.fixed_orientation()
            if fixed is None:
                raise InputError("no orientation: give --height, --pose-source, or Hoc in the lens file")
            return fixed
        poses, arrived = self._poses.poses, self._poses.arrived
        deadline = time.monotonic() + 1e-3 * settings.wait_ms
        while poses.newest < shot.captured:
            left = deadline - time.monotonic()
            if left <= 0.0:
                break
            arrived.clear()
            try:
                await asyncio.wait_for(arrived.wait(), left)
            except asyncio.TimeoutError:
                break
        return settings.corrected(poses.at(shot.captured))
