"""Hundreds of connections to each socket: frames go on, the status answers, and the log stays short."""

import io
import json
import resource
import socket
import time
from contextlib import ExitStack

import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import LENS, counts, running
from tests.vm_embedded.poses.test_stream import MOTION, free_port, pose_line
from vm_embedded.live.log import EventLog

DESCRIPTORS = 200
"""Limit of the daemon's open files; there are more connections than that."""


def few_descriptors():
    resource.setrlimit(resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))


def sockets(tmp_path):
    """Options of a daemon with every kind of socket, and the address of each."""
    (tmp_path / "vm.toml").write_text(LENS)
    port = free_port()
    options = ("--camera", "synthetic", "--config", tmp_path / "vm.toml", "--pose-source", f"unix:{tmp_path / 'poses'}")
    options += ("--output-unix", tmp_path / "lines", "--status-page", f"127.0.0.1:{port}")
    unix = {name: str(tmp_path / name) for name in ("poses", "lines", "control")}
    return options, unix | {"page": ("127.0.0.1", port)}


def connected(address, stack):
    """A connection that stays open until the end of the test."""
    made = socket.socket(socket.AF_UNIX if isinstance(address, str) else socket.AF_INET)
    stack.enter_context(made)
    made.connect(address)
    return made


@pytest.mark.parametrize(
    "name", ["lines", *(pytest.param(each, marks=pytest.mark.long) for each in ("poses", "control", "page"))]
)
def test_attack_6_hundreds_of_silent_connections_do_no_harm(name, tmp_path):
    options, addresses = sockets(tmp_path)
    with running(tmp_path, *options, preexec_fn=few_descriptors) as found, ExitStack() as stack:
        found.wait(lambda: found.states)
        sender = connected(addresses["poses"], stack)
        sender.sendall(pose_line(MOTION, time.monotonic()))
        found.wait(lambda: counts(tmp_path)["poses"] == 1)
        for _ in range(2 * DESCRIPTORS):
            connected(addresses[name], stack)
        # The sender from before is still connected, a new one is let in, and the status answers.
        late = connected(addresses["poses"], stack)
        for connection in (sender, late):
            connection.sendall(pose_line(MOTION, time.monotonic()))
        found.wait(lambda: counts(tmp_path)["poses"] == 3)
        page = connected(addresses["page"], stack)
        page.sendall(b"GET /state HTTP/1.0\r\n\r\n")
        page.settimeout(20.0)
        assert page.recv(65536).startswith(b"HTTP/1.1 200 OK")
        before = len(found.messages)
        found.wait(lambda: len(found.messages) > before + 2)
        assert found.stop()[0] == 0
    assert len(found.events) < 100


@pytest.mark.long
def test_readers_of_lines_are_served_while_others_flood_their_socket(tmp_path):
    options, addresses = sockets(tmp_path)
    with running(tmp_path, *options, preexec_fn=few_descriptors) as found, ExitStack() as stack:
        found.wait(lambda: found.states)
        reader = connected(addresses["lines"], stack).makefile("rb")
        stack.enter_context(reader)
        for _ in range(2 * DESCRIPTORS):
            connected(addresses["lines"], stack)
        for _ in range(3):
            assert read_message(reader.readline())["type"] == "state"
        found.stop()


def test_attack_6_the_log_has_at_most_fifty_lines_of_a_kind_in_ten_seconds(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    log = EventLog(stream)
    for _ in range(1000):
        log("internal error", "error")
    log("state", state="ok")
    lines = stream.getvalue().splitlines()
    assert len(lines) == 51
    assert json.loads(lines[-1])["event"] == "state"
    now[0] += 11.0
    log("internal error", "error")
    assert json.loads(stream.getvalue().splitlines()[-1])["left_out"] == 950
    log("internal error", "error")
    assert "left_out" not in json.loads(stream.getvalue().splitlines()[-1])
