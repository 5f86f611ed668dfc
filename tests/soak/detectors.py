"""A real vm-detect for hours: what it says is checked line by line as it comes, and only what matters is kept."""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.vm_embedded.live.running import arguments
from vm_embedded.live.control import ask

from .failing_camera import Fault

PATIENCE = 120.0
"""Seconds after which a detector that does not become what it should is given up."""

EXPECTED_EVENTS = ("ready", "status page", "state", "reason", "stopped")
"""Events that may be logged, whatever the camera does."""


class Detector:
    """A process, and what it has said so far.

    frames: number of frames it has reported. states: times, by the wall clock [s], and names of states, as they
    changed. unexpected: lines that it should not have written, or frames that it should not have reported.
    """

    def __init__(self, process: subprocess.Popen[bytes], check_frame: Callable[[Mapping[str, Any]], bool]) -> None:
        self.process = process
        self.frames = 0
        self.events: Counter[str] = Counter()
        self.states: list[tuple[float, str]] = []
        self.ready = 0.0
        self.unexpected: list[str] = []
        self._check_frame = check_frame
        self._threads = [
            threading.Thread(target=self._listen, args=(stream, take), daemon=True)
            for stream, take in ((process.stdout, self._take_message), (process.stderr, self._take_event))
        ]
        for each in self._threads:
            each.start()

    def _listen(self, stream: Any, take: Callable[[dict[str, Any]], bool]) -> None:
        for line in stream:
            try:
                is_expected = take(json.loads(line))
            except (ValueError, KeyError, TypeError):
                is_expected = False
            if not is_expected:
                self.unexpected.append(line.decode(errors="replace"))

    def _take_message(self, message: dict[str, Any]) -> bool:
        if message["type"] == "frame":
            self.frames += 1
            return self._check_frame(message)
        return bool(message["type"] == "state")

    def _take_event(self, event: dict[str, Any]) -> bool:
        name = event["event"]
        self.events[name] += 1
        if name == "state":
            self.states.append((event["time"], event["state"]))
        if name == "ready":
            self.ready = event["time"]
        return name in EXPECTED_EVENTS

    def wait(self, what: Callable[[], bool], seconds: float = PATIENCE) -> None:
        """Wait until what() is true. Raises TimeoutError."""
        deadline = time.monotonic() + seconds
        while not what():
            if time.monotonic() > deadline or self.process.poll() is not None:
                status = self.process.poll()
                raise TimeoutError(f"waited in vain; status {status}, {self.states[-5:]}, {self.unexpected[-3:]}")
            time.sleep(0.02)

    def is_ok(self) -> bool:
        """Whether the last state is ok."""
        return bool(self.states) and self.states[-1][1] == "ok"

    def resident(self) -> int:
        """Memory of the process [bytes]."""
        return resident_memory(self.process.pid)

    def open_things(self) -> tuple[int, int]:
        """Threads and descriptors of the process."""
        folder = Path(f"/proc/{self.process.pid}")
        return len(list((folder / "task").iterdir())), len(list((folder / "fd").iterdir()))

    def stop(self) -> int:
        """Ask it to stop, and return its exit status."""
        self.process.terminate()
        status = self.process.wait(PATIENCE)
        for each in self._threads:
            each.join(PATIENCE)
        return status


def resident_memory(pid: int) -> int:
    """Memory of a process [bytes]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def status(folder: Path) -> dict[str, Any]:
    """What the status socket of a detector in a folder answers."""
    answer: dict[str, Any] = json.loads(ask(folder / "control", "status"))
    return answer


@contextmanager
def detector(
    folder: Path,
    *options: object,
    faults: Sequence[Fault] = (),
    check_frame: Callable[[Mapping[str, Any]], bool] = lambda _: True,
) -> Iterator[Detector]:
    """A detector with its sockets in a folder. It ends with the block, whatever happens in it."""
    folder.mkdir(parents=True, exist_ok=True)
    command = arguments(folder, *options, faults=faults)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield Detector(process, check_frame)
        finally:
            process.kill()
