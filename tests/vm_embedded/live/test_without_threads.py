"""A system that gives no more threads, as with `ulimit -u`: the daemon ends in order."""

import json
import subprocess
import sys

import pytest

from tests.soak.faults import QUICK, SMALL
from tests.vm_embedded.live.running import Running

NO_THREADS = """
import os, sys, threading

start = threading.Thread.start

def refused(thread):
    if os.path.exists(sys.argv[1]):
        raise RuntimeError("can't start new thread")
    start(thread)

threading.Thread.start = refused
from tests.soak.failing_camera import main
sys.exit(main(sys.argv[2:]))
"""
"""vm-detect that gets no more threads once a file exists, with a synthetic camera that has faults."""


@pytest.fixture
def start(tmp_path):
    """Starts vm-detect with faults and options; its file is tmp_path/full."""
    processes = []

    def start(*options, faults=()):
        options = ("--status-socket", tmp_path / "control", "--max-distance", "6", *options)
        command = [sys.executable, "-c", NO_THREADS, str(tmp_path / "full"), json.dumps(faults), *map(str, options)]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE))
        return Running(processes[-1])

    yield start
    for each in processes:
        each.kill()
        each.wait()


@pytest.mark.long
def test_it_ends_in_order(start, tmp_path):
    found = start("--recorder-folder", tmp_path / "recordings")
    found.wait_for_state("ok")
    (tmp_path / "full").touch()
    assert found.stop()[0] == 0
    assert found.errors == []
    assert found.events[-1]["event"] == "stopped"
    assert found.messages[-1]["state"] == "stopping"


@pytest.mark.long
def test_a_camera_that_can_not_be_opened_again_ends_it_with_a_status_that_asks_for_a_new_start(start, tmp_path):
    found = start(*QUICK, *SMALL, faults=[("hang", 3.0, 600.0)])
    found.wait_for_state("ok")
    (tmp_path / "full").touch()
    assert found.process.wait(60.0) == 75
    found.stop()
    assert found.errors == []
    assert found.events[-1]["reason"] == "the camera can't be opened: can't start new thread"
