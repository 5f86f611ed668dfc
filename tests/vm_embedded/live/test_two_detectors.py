"""Two vm-detect that start at once beside the sockets of a killed one: one owns all sockets, the other one ends."""

import json
import multiprocessing
import os
import select
import signal
import socket
import struct
import sys
import traceback

import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import LENS, PATIENCE, arguments
from tests.waiting import wait
from vm_embedded.live.control import ask

SPAWN = multiprocessing.get_context("spawn")
SOCKETS = ("control", "lines", "poses", "page")


def fork_detectors(pipe, options, logs):
    """Import vm-detect once, and fork one for each log, again and again: most of a start would go into imports.

    Each True that is received starts them and sends their numbers. The next one kills them and sends their statuses.
    """
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # its thread would be missing in the forks
    from vm_embedded.cli import detect
    from vm_embedded.detection import detector  # noqa: F401 (for its imports)

    while pipe.recv():
        processes = [os.fork() or run_detector(detect.main, options, log) for log in logs]
        pipe.send(processes)
        pipe.recv()
        for each in processes:
            os.kill(each, signal.SIGKILL)
        pipe.send([os.waitstatus_to_exitcode(os.waitpid(each, 0)[1]) for each in processes])


def run_detector(main, options, log):
    """Become a vm-detect that logs to a file."""
    status = 1
    try:
        for descriptor, path in ((0, os.devnull), (1, os.devnull), (2, log)):
            os.dup2(os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC), descriptor)
        status = main(options)
    finally:
        if sys.exc_info()[0]:
            traceback.print_exc()
        os._exit(status)


def wait_for_an_end(processes):
    """Wait until one of these processes ends; return its place among them."""
    descriptors = [os.pidfd_open(each) for each in processes]
    try:
        ended, _, _ = select.select(descriptors, [], [], PATIENCE)
        assert len(ended) == 1
        return descriptors.index(ended[0])
    finally:
        for each in descriptors:
            os.close(each)


def events(log):
    """The complete events of a log."""
    return [json.loads(line) for line in log.read_text().splitlines(keepends=True) if line.endswith("\n")]


def process_at(path):
    """The process that listens at a path."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(PATIENCE)
        connection.connect(str(path))
        return struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]


@pytest.mark.parametrize("rounds", [3, pytest.param(300, marks=pytest.mark.long)])
def test_of_two_that_start_at_once_one_owns_all_sockets_and_the_other_says_so_and_ends(tmp_path, rounds):
    folder, logs = tmp_path / "sockets", [tmp_path / "first", tmp_path / "second"]
    folder.mkdir()
    (tmp_path / "vm.toml").write_text(LENS)
    options = arguments(folder, "--config", tmp_path / "vm.toml", "--camera", "synthetic", "--camera-fps", 2)[1:]
    options += ["--output-unix", str(folder / "lines"), "--pose-source", f"unix:{folder / 'poses'}"]
    options += ["--status-page", f"unix:{folder / 'page'}"]
    for name in SOCKETS:
        with socket.socket(socket.AF_UNIX) as left:
            left.bind(str(folder / name))
    pipe, theirs = SPAWN.Pipe()
    starter = SPAWN.Process(target=fork_detectors, args=(theirs, options, logs), daemon=True)
    starter.start()
    theirs.close()
    for _ in range(rounds):
        pipe.send(True)
        processes = pipe.recv()
        try:
            loser = wait_for_an_end(processes)
            owner, log = processes[1 - loser], logs[1 - loser]
            wait(lambda log=log: any(each["event"] == "ready" for each in events(log)))
            assert [process_at(folder / each) for each in SOCKETS] == 4 * [owner]
            assert read_message(ask(folder / "control", "status"))["type"] == "state"
        finally:
            pipe.send(True)
            statuses = pipe.recv()
        assert (statuses[loser], statuses[1 - loser]) == (78, -signal.SIGKILL)
        last = events(logs[loser])[-1]
        assert last["event"] == "can't start"
        assert f"can't listen at {folder}" in last["reason"]
        assert "another process already does" in last["reason"]
        # The owner was killed, so its sockets are left to the next two.
        assert sorted(each.name for each in folder.iterdir()) == sorted(SOCKETS)
    pipe.send(False)
    starter.join(PATIENCE)
    assert starter.exitcode == 0
