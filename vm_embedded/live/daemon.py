"""The daemon of vm-detect: takes frames and poses, sends a message for each frame, and reports its own state.

Other threads read the camera and write files. The event loop waits for the newest shot, a frame with its time. It has
answering.py detect the objects in it, and sends the result. Between shots it answers the status socket and HTTP, reads
poses, and notifies systemd's watchdog. This module starts and stops these parts, and handles the signals to stop,
reload and record.
"""

from __future__ import annotations

import asyncio
import math
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

from ..borders.clock import wall_offset
from ..borders.credentials import without_password
from ..borders.sockets import is_open_to_network
from ..borders.text import to_json
from ..cameras.grabber import Grabber
from ..cameras.open_camera import Opener
from ..detection.detector import Detector
from ..errors import InputError, NetworkError, VisualMeshError, one_line
from ..geometry.orientation import Orientation
from ..output.channels import Channels
from ..output.messages import LiveFrame, Message, live_frame, state_message
from ..output.recorder import Moment, Recorder
from ..poses.stream import PoseStream
from .answering import Answer, Answerer
from .bridge import Bridge
from .configuration import Configuration, recording_files
from .control import REFUSED, ControlServer, control_path
from .counters import Counters
from .daemon_state import DaemonState
from .frame_remarks import FrameRemarks
from .frame_watchdog import FrameWatchdog
from .health import Health
from .load_detector import find_opener, load_checked_detector
from .log import EventLog
from .reloading import read_again
from .status_page import StatusPage
from .system import give_back_memory, resident_bytes
from .systemd import SystemdNotifier

EXIT_OK, EXIT_FAILED, EXIT_RESTART, EXIT_CONFIGURATION = 0, 1, 75, 78
"""As in sysexits.h: 75 (EX_TEMPFAIL) asks for a restart, 78 (EX_CONFIG) says that a restart would fail again."""

_TICK = 0.02
"""Longest wait for a shot before the loop checks its clocks [s]."""

_SWITCH_INTERVAL = 0.0005
"""How long another thread may keep the interpreter while a frame waits [s]; Python's default is 5 ms."""

_NETWORK_S = 15.0
"""Longest wait for the network at the start [s]; the unit's TimeoutStartSec is 30 s, and the proof takes some, too."""

_HEARTBEAT = 1.0
"""Longest pause between two messages [s]."""

_RECORDING_S = 3.5
"""Longest wait for a recording when the daemon stops [s]; the unit's TimeoutStopSec is 5 s."""

_LAST_WORDS_S = 0.3
"""Time for the threads of the outputs to write the last message of a process that hangs [s]."""

_CLOCK_JUMP = 0.5
"""Change of the wall clock relative to the monotonic clock that is logged [s]."""


class Part(Protocol):
    """A part that the daemon opens at the start and closes at the end."""

    async def open(self) -> None:
        """Start. Raises InputError."""

    async def close(self) -> None:
        """Release all resources."""


class Daemon:
    """Runs until a signal stops it, the camera ends, or too many reads of the camera hang.

    configure: reads the configuration for each reload. opener: opens the camera. proved: in words, what shows that the
    detector works. bridge: to other robot software. readable: standard output gets lines for people.
    """

    def __init__(
        self,
        configure: Callable[[], Configuration],
        configuration: Configuration,
        opener: Opener,
        detector: Detector,
        proved: str,
        log: EventLog,
        bridge: Bridge | None = None,
        readable: bool = False,
    ) -> None:
        self._configure = configure
        self._proved = proved
        self._log = log
        self._bridge = bridge
        camera, status = configuration.camera, configuration.status
        self._recorder = Recorder(
            configuration.recorder,
            recording_files(configuration, detector.session.model),
            lambda event, level, folder: log(event, level, folder=folder),
        )
        self._last: LiveFrame | None = None
        self._health = Health(1e-3 * camera.lost_ms, (1e-3 * status.budget_ms) or math.inf)
        self._sent = 0.0  # when the last message was sent
        self._stops = 0  # how often a signal has asked to stop
        self._notifier = SystemdNotifier()
        self._stuck = ""  # why only a new process helps; empty if none is needed
        self._wakeup = asyncio.Event()
        self._reloading: asyncio.Task[None] | None = None
        self._grabber = Grabber(opener, camera, self._wake)
        self._poses = PoseStream(configuration.pose, self._report_bad_pose)
        self._outputs = Channels(configuration.output, readable)
        self._counters = Counters(self._grabber, self._poses, self._outputs)
        self._watchdog = FrameWatchdog(self._end_hanging)
        self.answerer = Answerer(configuration, detector, self._poses, self._counters, self._health, self._watchdog)
        self._remarks = FrameRemarks(_fixed_pose(configuration))
        self._state = DaemonState(self._health, self._grabber, self._outputs, log, self._notifier)
        self.page = StatusPage(self.answerer, self._status, self._record, self._metrics, self._use_threshold)
        commands = {"status": lambda: to_json(self._status(), allow_nan=False), "record": self._record}
        control = ControlServer(control_path(status.socket), commands | {"metrics": self._metrics})
        self._parts: list[Part] = [self._outputs, self._poses, control, *self.page.servers()]

    @classmethod
    async def prepare(
        cls,
        configure: Callable[[], Configuration],
        log: EventLog,
        bridge: Bridge | None = None,
        readable: bool = False,
    ) -> Daemon:
        """A daemon whose configuration was read and whose detector was proved. Raises VisualMeshError."""
        configuration = configure()
        opener = find_opener(configuration, bridge)  # its checks are quick, so they are the first
        detector, proved = await load_checked_detector(configuration)
        return cls(configure, configuration, opener, detector, proved, log, bridge, readable)

    @property
    def _configuration(self) -> Configuration:
        """The current configuration."""
        return self.answerer.configuration

    async def run(self) -> int:
        """Run, and return the exit status. Raises InputError if a part can't be opened."""
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._log_loop_error)
        self._handle_signals()
        sys.setswitchinterval(_SWITCH_INTERVAL)
        try:
            await self._open_parts()
        except InputError:
            await self._close()
            if not self._stops:
                raise
        else:
            self._start()
            while not (self._stops or self._stuck or self._camera_ended()):
                await self._step()
            self._health.stopping = True
            self._update_state()
            self._notifier.send(STOPPING=1)
            await self._close()
        status, reason = self._exit_status()
        self._log("stopped", frames=self._counters.outcomes.frames, reason=reason)
        return status

    def _handle_signals(self) -> None:
        for number, handle in (
            (signal.SIGTERM, self._stop),
            (signal.SIGINT, self._stop),
            (signal.SIGHUP, self._start_reload),
            (signal.SIGUSR1, self._record),
        ):
            self._loop.add_signal_handler(number, handle)

    async def _open_parts(self) -> None:
        for part in self._parts:
            await self._open(part)
        if self._bridge is not None:
            await self._bridge.open(self._poses)

    def _start(self) -> None:
        """Begin to take frames, once all parts are open, and say so."""
        camera, status = self._configuration.camera, self._configuration.status
        for entry, address in (("page", status.page), ("metrics", status.metrics)):
            if address and is_open_to_network(address):
                self._log("open to the network", "warning", entry=f"[status] {entry}", address=address)
        self._recorder.finish_left()
        self._grabber.start()
        self._watchdog.start()
        self._update_state()
        self._notifier.send(READY=1)
        self._log("ready", model=self._configuration.model, proved=self._proved, camera=without_password(camera.source))
        if status.page:
            self._log("status page", url=f"http://{status.page}/", token=self.page.token)
            if self.page.not_kept:
                self._log("the next start will have another token", "warning", reason=self.page.not_kept)
        self._clock_offset = wall_offset()

    async def _open(self, part: Part) -> None:
        """Open a part; wait some seconds for the network if that needs it. Raises InputError."""
        deadline, reason = time.monotonic() + _NETWORK_S, ""
        while True:
            try:
                return await part.open()
            except NetworkError as error:
                if self._stops or time.monotonic() > deadline:
                    raise
                if str(error) != reason:
                    reason = str(error)
                    self._log("waiting for the network", "warning", reason=reason)
            await asyncio.sleep(0.2)

    def _log_loop_error(self, _: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log what asyncio would report as a traceback, such as too many open files, in a line."""
        error = context.get("exception")
        self._log("internal error", "error", where=context.get("message", ""), reason=one_line(error) if error else "")

    def _exit_status(self) -> tuple[int, str]:
        """The exit status, and the reason why the daemon stops."""
        if self._stuck:
            return EXIT_RESTART, self._stuck
        if self._stops:
            return EXIT_OK, "signal"
        return EXIT_OK if self._counters.outcomes.frames else EXIT_FAILED, "the camera has ended"

    def _camera_ended(self) -> bool:
        """Whether the camera has ended and its last shot was taken."""
        return self._grabber.ended and not self._grabber.has_shot

    async def _step(self) -> None:
        """Wait for a shot or for one tick, and do all that is due."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._wakeup.wait(), _TICK)
        self._wakeup.clear()
        self._notifier.feed_watchdog()
        self._log_clock_jump()
        self._update_state()
        shot = self._grabber.take()
        if shot is not None:
            answer = await self.answerer.answer(shot)
            if answer is not None:
                self._report(answer)
                if not self._grabber.has_shot:
                    self.answerer.prepare(answer)
        if time.monotonic() - self._sent > _HEARTBEAT:
            self._send(state_message(self._state.name, self._state.reason))
        # A signal during this step goes first: it ends the daemon with EXIT_OK.
        self._stuck = "" if self._stops else self._grabber.stuck

    def _log_clock_jump(self) -> None:
        jump = wall_offset() - self._clock_offset
        if abs(jump) > _CLOCK_JUMP:
            self._log("clock jumped", "warning", seconds=round(jump, 3))
            self._clock_offset += jump

    def _report(self, answer: Answer) -> None:
        """Send an answer to the outputs, and hand it to the status page and the recorder."""
        self._update_state()
        shot, detections = answer.shot, answer.detections
        # The camera may be lost while its last frame is processed; a frame that says so would contradict itself.
        state = "degraded" if self._state.name == "camera_lost" else self._state.name
        self._last = live_frame(self._counters.outcomes.frames, state, shot, detections, answer.time)
        message = self._last.as_dict()
        self._send(message, answer)
        for event, reason in self._remarks.about(answer):
            self._log(event, "warning", reason=reason)
        self.page.show(answer)
        self._recorder.keep(Moment(shot, answer.lens, answer.orientation, message))

    def _report_bad_pose(self, reason: str) -> None:
        self._health.add_trouble(time.monotonic(), reason)

    def _update_state(self) -> None:
        """Determine the state; send a new one, and a new reason of a bad one."""
        if self._state.update():
            self._send(state_message(self._state.name, self._state.reason))

    def _send(self, message: Message, answer: Answer | None = None) -> None:
        self._sent = time.monotonic()
        self._outputs.send(message)
        if self._bridge is not None:
            self._bridge.publish(message, answer)

    def _status(self) -> Message:
        """State, counts, and the last frame's message."""
        return state_message(
            self._state.name,
            self._state.reason,
            counts=self._counters.counts(),
            memory_mib=resident_bytes() / 2**20,
            model_sha256=self.answerer.detector.session.model.sha256,
            last=self._last,
        )

    def _use_threshold(self, name: str, value: float) -> None:
        """Let recordings have a threshold that the status page has changed."""
        self._begin_recording_anew()
        self._log("threshold changed", "warning", **{name: value})

    def _metrics(self) -> str:
        """All metrics in Prometheus's text format."""
        pose = self.answerer.pose_check.state
        return self._counters.metrics(self._state.name, self.answerer.detector.cache, self._health.answered, pose)

    def _begin_recording_anew(self) -> None:
        """Let recordings have the current configuration and network."""
        self._recorder.begin_anew(recording_files(self._configuration, self.answerer.detector.session.model))

    def _record(self) -> str:
        """Start to write a recording of the last seconds; return where it goes, or REFUSED and the reason."""
        try:
            result = self._recorder.record()
        except InputError as error:
            self._log("not recorded", "warning", reason=str(error))
            return f"{REFUSED}{error}"
        self._log("recording", result=result)
        return result

    def _wake(self) -> None:
        """Wake the loop from another thread, if it still runs."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._wakeup.set)

    def _start_reload(self) -> None:
        """Begin a reload, instead of one that has not ended."""
        if self._reloading is not None:
            self._reloading.cancel()
        self._reloading = self._loop.create_task(self._reload())

    async def _reload(self) -> None:
        """Read the configuration and the model again. If anything is wrong, nothing changes."""
        try:
            new = await read_again(self._configure, self._configuration, self._bridge)
        except Exception as error:  # noqa: BLE001 (nobody else would hear of it)
            reason = str(error) if isinstance(error, VisualMeshError) else one_line(error)
            self._log("reload refused", "error", reason=reason)
            return
        had, has = (
            ", ".join(each.name for each in detector.manifest.classes)
            for detector in (self.answerer.detector, new.detector)
        )
        if had != has:
            self._log("other classes", "warning", before=had, now=has)
        self.answerer.reload(new.configuration, new.detector)
        self._begin_recording_anew()
        self._remarks = FrameRemarks(_fixed_pose(new.configuration))
        give_back_memory()
        self._log("reloaded", model=new.configuration.model, proved=new.proved, needs_restart=new.needs_restart)

    def _stop(self) -> None:
        self._stops += 1
        if self._stops > 1:
            os._exit(EXIT_FAILED)  # the second signal ends the process at once
        self._wakeup.set()

    def _end_hanging(self) -> None:
        """End the process, whose event loop hangs in a frame. Called in another thread."""
        reason = f"a frame takes more than {FrameWatchdog.limit:g} s"
        self._log("stopped", "error", frames=self._counters.outcomes.frames, reason=reason)
        self._outputs.send(state_message("stopping", reason))
        self._notifier.send(STATUS=f"stopping: {reason}")
        time.sleep(_LAST_WORDS_S)
        os._exit(EXIT_RESTART)

    async def _close(self) -> None:
        self._watchdog.close()
        if self._reloading is not None:
            self._reloading.cancel()
        if self._bridge is not None:
            await self._bridge.close()
        for part in self._parts:
            await part.close()
        await self._recorder.close(_RECORDING_S)
        self._grabber.stop(0.3)
        self._notifier.close()


def _fixed_pose(configuration: Configuration) -> Orientation | None:
    """The pose of a configuration that gives one for all frames."""
    return configuration.fixed_orientation() if configuration.pose.source == "fixed" else None
