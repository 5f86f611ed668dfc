"""Two vm-detect that start at once beside the sockets of a killed one: one owns all sockets, the other one ends."""

import json
import socket
import struct
import subprocess
from contextlib import contextmanager

import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import LENS, arguments
from tests.waiting import wait
from vm_embedded.live.control import ask

SOCKETS = ("control", "lines", "poses", "page")


@contextmanager
def two_started(command, folder):
    """Two processes of a command, with their standard errors as files. They are killed at the end of the block."""
    logs = [folder / "first", folder / "second"]
    started = []
    try:
        for log in logs:
            with log.open("wb") as errors:
                started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors))
        yield list(zip(started, logs, strict=True))
    finally:
        for each in started:
            each.kill()
            each.wait()


def events(log):
    """The complete events of a log."""
    return [json.loads(line) for line in log.read_text().splitlines(keepends=True) if line.endswith("\n")]


def process_at(path):
    """The process that listens at a path."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(10.0)
        connection.connect(str(path))
        return struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]


@pytest.mark.parametrize("rounds", [2, pytest.param(300, marks=pytest.mark.long)])
def test_of_two_that_start_at_once_one_owns_all_sockets_and_the_other_says_so_and_ends(tmp_path, rounds):
    folder = tmp_path / "sockets"
    folder.mkdir()
    (tmp_path / "vm.toml").write_text(LENS)
    command = arguments(folder, "--config", tmp_path / "vm.toml", "--camera", "synthetic")
    command += ["--output-unix", str(folder / "lines"), "--pose-source", f"unix:{folder / 'poses'}"]
    command += ["--status-page", f"unix:{folder / 'page'}"]
    for name in SOCKETS:
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(folder / name))
    for _ in range(rounds):
        with two_started(command, tmp_path) as both:
            (loser, log) = wait(lambda both=both: next((each for each in both if each[0].poll() is not None), None))
            (owner, owner_log) = both[1 - both.index((loser, log))]
            assert loser.returncode == 78
            assert events(log)[-1]["event"] == "can't start"
            assert f"can't listen at {folder}" in events(log)[-1]["reason"]
            assert "another process already does" in events(log)[-1]["reason"]
            wait(lambda log=owner_log: any(each["event"] == "ready" for each in events(log)))
            assert [process_at(folder / each) for each in SOCKETS] == 4 * [owner.pid]
            assert read_message(ask(folder / "control", "status"))["type"] == "state"
            assert owner.poll() is None
        # It was killed, so its sockets are left to the next two.
        assert sorted(each.name for each in folder.iterdir()) == sorted(SOCKETS)
