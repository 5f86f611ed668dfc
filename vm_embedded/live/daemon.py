"""A detector that runs for as long as the robot does: frames and poses in, messages out, and the truth about itself.

One thread does everything but read the camera and write files: it waits for the newest shot, for the pose of that
shot's moment, detects, and sends. Nothing here waits for anybody else.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import cv2

from ..cameras.camera import Shot, without_password
from ..cameras.grabber import MOST_HANGING, Grabber
from ..cameras.open_camera import camera_opener, is_live
from ..config.toml_writer import to_commented_toml
from ..detection.detector import Detector
from ..errors import InputError, VisualMeshError, one_line
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from ..network.bundled import model_path
from ..output.channels import Channels
from ..output.messages import Message, frame_message, state_message
from ..output.recorder import Moment, Recorder
from ..poses.buffer import StalePoseError
from ..poses.stream import PoseStream
from .configuration import Configuration
from .control import Control, usual_path
from .counters import Figures
from .health import Health
from .http_server import Answer, WebServer
from .log import EventLog
from .prometheus import resident_bytes
from .status_page import StatusPage
from .systemd import Notifier

EXIT_OK, EXIT_FAILED, EXIT_HUNG, EXIT_CONFIGURATION = 0, 1, 75, 78
"""As sysexits.h has them: 75 asks to be started again, 78 says that it would be in vain."""

_TICK = 0.02
"""Seconds between two looks at clocks, if nothing else happens."""

_SWITCH = 0.0005
"""Seconds for which a thread may keep the interpreter while this one has a frame to answer; Python's own are 5 ms."""

_HEARTBEAT = 1.0
"""Seconds between two messages at most."""

REFUSED = "refused: "
"""What answers of the control socket begin with that are none."""

_FIXED = ("camera", "pose", "output", "status", "recorder")
"""Sections that count from the next start on."""

_CLOCK_JUMP = 0.5
"""Change of the wall clock against the monotonic one that is worth a word [s]."""


def ready(configuration: Configuration) -> Detector:
    """The configured network, its self-test done, if all that is configured goes together. Raises VisualMeshError."""
    detector = Detector.from_file(configuration.model, configuration.detector)
    camera, fixed = configuration.camera.source, configuration.orientation.orientation()
    if is_live(camera):
        camera_opener(configuration.camera, configuration.detector.format != "bgr")
    if configuration.recorder.trigger_class:
        detector.manifest.column(configuration.recorder.trigger_class)
    if is_live(camera) and camera.partition(":")[0] not in ("synthetic", "fault"):
        if configuration.lens is None:
            raise InputError(f"camera {without_password(camera)} needs a lens: give --lens")
        if configuration.pose.source == "fixed" and fixed is None:
            raise InputError(f"camera {without_password(camera)} needs poses: give --height, or --pose-source")
    return detector


class Part(Protocol):
    """What is opened at the start and closed at the end."""

    async def open(self) -> None:
        """Raises InputError."""

    async def close(self) -> None:
        """Give back what it holds."""


class Daemon:
    """Runs until it is told to stop.

    configure: reads the configuration, once at the start and again whenever it is asked to.
    """

    def __init__(self, configure: Callable[[], Configuration], log: EventLog) -> None:
        self._configure = configure
        self._log = log
        self._configured(configure())
        self.recorder = Recorder(self.configuration.recorder, lambda event, what: log(event, folder=what))
        self.last: Message | None = None
        self.figures = Figures()
        self.state, self.reason = "", ""
        budget = 1e-3 * self.configuration.status.budget_ms or math.inf
        self.health = Health(1e-3 * self.configuration.camera.lost_ms, budget)
        self._spoilt = 0  # frames that the camera gave in vain
        self._sent = 0.0  # when the last message was
        self._fed = 0.0  # when the watchdog was
        self._stops = 0  # times that it was told to stop
        self._notifier = Notifier()
        self._fatal: str | None = None
        self._woken = asyncio.Event()
        camera, status = self.configuration.camera, self.configuration.status
        raw = self.configuration.detector.format != "bgr"
        self.grabber = Grabber(camera_opener(camera, raw), camera, self._wake)
        self.poses = PoseStream(self.configuration.pose, self._bad_pose)
        self.outputs = Channels(self.configuration.output)
        self.page = StatusPage(status.picture_fps, self._told)
        commands = {"status": self._status, "record": self.record, "metrics": self.metrics}
        control = Control(Path(status.socket) if status.socket else usual_path(), commands)
        self._parts: list[Part] = [self.outputs, self.poses, control, *self._servers()]

    def _configured(self, configuration: Configuration) -> None:
        """Take a configuration and load its network, whose self-test is done then. Raises VisualMeshError."""
        self.configuration, self.detector = configuration, ready(configuration)
        replayed = Configuration(
            model=str(Path(model_path(configuration.model)).resolve()), detector=configuration.detector
        )
        self._replay_toml = to_commented_toml(replayed)

    async def run(self) -> int:
        """Run, and return the exit status."""
        loop = asyncio.get_running_loop()
        sys.setswitchinterval(_SWITCH)
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self._stop)
        loop.add_signal_handler(signal.SIGHUP, self.reload)
        loop.add_signal_handler(signal.SIGUSR1, self.record)
        self._loop = loop
        try:
            for part in self._parts:
                await part.open()
        except InputError:
            await self._close()
            raise
        self.grabber.start()
        self._show_state()
        self._notifier.send(READY=1)
        self._log("ready", model=self.configuration.model, camera=without_password(self.configuration.camera.source))
        wall = time.time() - time.monotonic()
        while not self._stops and not self._finished():
            await self._step()
            drift = time.time() - time.monotonic() - wall
            if abs(drift) > _CLOCK_JUMP:
                self._log("clock jumped", "warning", seconds=round(drift, 3))
                wall += drift
        self.health.stopping = True
        self._show_state()
        self._notifier.send(STOPPING=1)
        await self._close()
        reason, frames = self._fatal or ("told to" if self._stops else "end of the camera"), self.figures.tally.frames
        self._log("stopped", frames=frames, reason=reason)
        return EXIT_HUNG if self._fatal else EXIT_OK if frames or self._stops else EXIT_FAILED

    def _servers(self) -> Iterator[WebServer]:
        status = self.configuration.status
        metrics = {"/metrics": lambda: Answer("text/plain; version=0.0.4", self.metrics().encode())}
        if status.page:
            pages = {"/": self.page.page, "/state": self.page.state, **metrics}
            yield WebServer(status.page, pages, {"/stream": self.page.stream})
        if status.metrics:
            yield WebServer(status.metrics, metrics)

    def _finished(self) -> bool:
        """Whether the camera has come to its end, or nothing but a new process helps."""
        if self.grabber.hanging >= MOST_HANGING:
            self._fatal = f"{MOST_HANGING} reads of the camera hang"
        return self._fatal is not None or (self.grabber.ended and not self.grabber.has_shot)

    async def _step(self) -> None:
        """Wait for a shot, or a moment, and do what is due."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._woken.wait(), _TICK)
        self._woken.clear()
        self._feed_watchdog()
        self._show_state()
        shot = self.grabber.take()
        if shot is not None:
            await self._answer(shot)
        if time.monotonic() - self._sent > _HEARTBEAT:
            self._send(state_message(self.state, self.reason))

    def _feed_watchdog(self) -> None:
        """Tell systemd that this loop runs, four times as often as it wants to hear it."""
        period, now = self._notifier.watchdog, time.monotonic()
        if period is not None and now - self._fed > 0.25 * period:
            self._fed = now
            self._notifier.send(WATCHDOG=1)

    async def _answer(self, shot: Shot) -> None:
        """Detect in a shot and say what was found, unless it is too old or has no pose."""
        if self._late(shot):
            return
        try:
            lens, orientation = self._lens(shot), await self._orientation(shot)
            self.health.pose_trouble = ""
            started = time.perf_counter()
            detections = self.detector.detect(shot.image, orientation, lens)
        except StalePoseError as error:
            self.figures.tally.stale += 1
            self.health.pose_trouble = str(error)
            return
        except (VisualMeshError, cv2.error, ValueError) as error:
            self.figures.tally.failed += 1
            self.health.trouble(time.monotonic(), one_line(error))
            return
        if self._late(shot):
            return
        now = time.monotonic()
        self.health.answer(now, now - shot.arrived)
        self.figures.answered(detections, time.perf_counter() - started, now - shot.captured)
        self._show_state()
        self.last = frame_message(self.figures.tally.frames, self.state, shot, detections, now)
        self._send(self.last)
        self.page.show(shot.image, detections)
        self.recorder.keep(Moment(shot, lens, orientation, self.last), self._replay_toml)

    def _late(self, shot: Shot) -> bool:
        """Whether a shot is too old to be reported."""
        age = time.monotonic() - shot.captured
        late = age > 1e-3 * self.configuration.camera.max_age_ms
        if late:
            self.figures.tally.late += 1
            self.health.trouble(time.monotonic(), f"frame is {1e3 * age:.0f} ms old")
        return late

    def _lens(self, shot: Shot) -> Lens:
        """The shot's own lens, or the configured one. Raises InputError."""
        given = self.configuration.lens
        lens = shot.lens or (given.lens if given is not None else None)
        if lens is None:
            raise InputError("no lens: give --lens")
        return lens

    async def _orientation(self, shot: Shot) -> Orientation:
        """Of the camera when the shot was taken. Raises StalePoseError or InputError."""
        pose = self.configuration.pose
        if pose.source == "fixed":
            fixed = shot.orientation or self.configuration.orientation.orientation()
            if fixed is None:
                raise InputError("no orientation: give --height, or --pose-source")
            return fixed
        poses = self.poses.poses
        deadline = time.monotonic() + 1e-3 * pose.wait_ms
        while pose.interpolate and poses.newest < shot.captured and (left := deadline - time.monotonic()) > 0.0:
            self.poses.arrived.clear()
            try:
                await asyncio.wait_for(self.poses.arrived.wait(), left)
            except TimeoutError:
                break
        return poses.at(shot.captured)

    def _bad_pose(self, why: str) -> None:
        self.health.trouble(time.monotonic(), why)

    def _show_state(self) -> None:
        """See what state it is in, and say so if it has changed."""
        now = time.monotonic()
        lost = self.grabber.supervise(now)
        if self.outputs.failure:
            self.health.trouble(now, f"lines are lost: {self.outputs.failure}")
        spoilt = self.grabber.counts.rejected
        if spoilt != self._spoilt:
            self._spoilt = spoilt
            self.health.trouble(now, self.grabber.trouble)
        state, reason = self.health.state(now, lost, self.grabber.trouble)
        if state != self.state:
            self._log(
                "state",
                "info" if state in ("ok", "starting", "stopping") else "warning",
                state=state,
                was=self.state,
                reason=reason,
            )
            self.state, self.reason = state, reason
            self._send(state_message(state, reason))
            self._notifier.send(STATUS=f"{state}{': ' if reason else ''}{reason}")
        self.reason = reason

    def _send(self, message: Message) -> None:
        self._sent = time.monotonic()
        self.outputs.send(message)

    def _told(self) -> Message:
        """State, counts, and what was seen last."""
        return state_message(self.state, self.reason) | {
            "counts": self._counted().counts(self.grabber.counts),
            "memory_mib": round(resident_bytes() / 2**20, 1),
            "model_sha256": self.detector.session.model.sha256,
            "last": self.last,
        }

    def _counted(self) -> Figures:
        """The figures, with what others count."""
        tally = self.figures.tally
        tally.poses, tally.poses_bad, tally.dropped = self.poses.received, self.poses.bad, self.outputs.dropped
        return self.figures

    def _status(self) -> str:
        return json.dumps(self._told(), allow_nan=False)

    def record(self) -> str:
        """Write down the last seconds."""
        try:
            said = self.recorder.record(self._replay_toml)
        except InputError as error:
            self._log("not recorded", "warning", reason=str(error))
            return f"{REFUSED}{error}"
        self._log("recording", result=said)
        return said

    def _wake(self) -> None:
        """Called in other threads, whose loop may be gone."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._woken.set)

    def reload(self) -> None:
        """Read configuration and model again; what is bad changes nothing."""
        try:
            before, configuration = self.configuration, self._configure()
            as_opened = replace(configuration.detector, format=before.detector.format)
            self._configured(replace(configuration, detector=as_opened))
        except VisualMeshError as error:
            self._log("reload refused", "error", reason=str(error))
            return
        self.recorder.forget()
        kept = {name: getattr(before, name) for name in _FIXED}
        waiting = [name for name, section in kept.items() if section != getattr(configuration, name)]
        if configuration.detector.format != before.detector.format:
            waiting.append("detector.format")
        self.configuration = replace(self.configuration, **kept)
        self._log("reloaded", model=configuration.model, needs_restart=waiting)

    def _stop(self) -> None:
        self._stops += 1
        if self._stops > 1:
            os._exit(EXIT_FAILED)
        self._woken.set()

    async def _close(self) -> None:
        for part in self._parts:
            await part.close()
        self.recorder.close(0.3)
        self.grabber.stop(0.3)
        self._notifier.close()

    def metrics(self) -> str:
        """For Prometheus."""
        return self._counted().metrics(self.state, self.grabber.counts, self.detector.cache, self.health.answered)
