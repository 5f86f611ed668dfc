"""A real vm-detect on a live camera, for tests: started, listened to, stopped."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

from tests.messages import checked, read_message
from tests.soak import failing_camera
from vm_embedded.live.control import ask

COMMAND = Path(sys.executable).parent / "vm-detect"
DEMO = Path(__file__).parents[2] / "fixtures" / "demo"
LENS = '[lens]\nprojection = "rectilinear"\nfocal_length = 448\nfov = 1.75\n[orientation]\nheight = 0.8\npitch = 0.4\n'
"""A vm.toml for the images of a synthetic camera of 640 pixels."""

PATIENCE = 60.0
"""Seconds after which a test gives up waiting; never what is measured."""


class Running:
    """A process, the messages that it has sent, and the events that it has logged."""

    def __init__(self, process):
        self.process = process
        self.messages, self.events, self.errors = [], [], []
        self._seen = 0
        self._threads = [
            threading.Thread(target=self._listen, args=(process.stdout, self.messages), daemon=True),
            threading.Thread(target=self._listen, args=(process.stderr, self.events), daemon=True),
        ]
        for each in self._threads:
            each.start()

    def _listen(self, stream, kept):
        for line in stream:
            try:
                kept.append(json.loads(line))
            except ValueError:
                self.errors.append(line)

    @property
    def frames(self):
        return [each for each in list(self.messages) if each["type"] == "frame"]

    @property
    def states(self):
        """States one after another, as they changed."""
        return [each["state"] for each in list(self.events) if each["event"] == "state"]

    def wait(self, what, seconds=PATIENCE):
        """Wait until what() is true, and return it."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            found = what()
            if found:
                return found
            assert self.process.poll() is None, (self.process.returncode, self.events[-5:], self.errors)
            time.sleep(0.02)
        raise AssertionError(f"waited in vain: {self.states}, {self.messages[-2:]}, {self.events[-5:]}, {self.errors}")

    def wait_for_state(self, state, seconds=PATIENCE):
        """Wait until a state comes after those that were waited for before."""
        self.wait(lambda: state in self.states[self._seen :], seconds)
        self._seen += self.states[self._seen :].index(state) + 1

    def stop(self, number=signal.SIGTERM):
        """Stop it, and return its exit status and how long that took [s]."""
        started = time.monotonic()
        self.process.send_signal(number)
        status = self.process.wait(PATIENCE)
        for each in self._threads:
            each.join(PATIENCE)
        return status, time.monotonic() - started


def arguments(tmp_path, *options, faults=()):
    """A command line whose sockets are in a folder of the test. With faults, its camera is synthetic and has them."""
    command = failing_camera.command(faults) if faults else [str(COMMAND)]
    return [*command, "--status-socket", str(tmp_path / "control"), "--max-distance", "6", *map(str, options)]


def counts(tmp_path):
    """What a detector counts that runs with these arguments."""
    return read_message(ask(tmp_path / "control", "status"))["counts"]


@contextmanager
def running(tmp_path, *options, faults=(), env=None, **more):
    """A process that ends with the block, whatever happens in it."""
    process = subprocess.Popen(
        arguments(tmp_path, *options, faults=faults),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, **(env or {})},
        **more,
    )
    found = Running(process)
    try:
        yield found
        assert not found.errors, found.errors
        for each in list(found.messages):
            checked(each)
    finally:
        process.kill()
        process.wait()
        for each in (process.stdout, process.stderr, process.stdin):
            if each is not None:
                each.close()
