"""A model file is proved in another process, whose limits stop what a hostile file may do."""

import asyncio
import os
import signal
import socket
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests.vm_embedded.live.running import COMMAND, arguments, running
from tests.vm_embedded.network.burdened import endless, endless_on_many_points, huge
from vm_embedded.errors import ModelError
from vm_embedded.live.daemon import EXIT_RESTART
from vm_embedded.live.frame_watchdog import FrameWatchdog
from vm_embedded.live.proving_process import modules_are_public, prove_in_process
from vm_embedded.network.bundled import model_path

pytest.importorskip("onnxruntime")

BALL = model_path("ball").read_bytes()


def proved(content):
    return asyncio.run(prove_in_process("model.onnx", content))


def children():
    """The processes that this one started, without those that have ended."""
    listed = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return [int(each) for path in listed for each in path.read_text().split()]


def test_a_good_model_is_proved():
    assert proved(BALL).startswith("self-test passed, canary found (1 ball, ")


@pytest.mark.parametrize("content", [b"", b"no model", BALL[: len(BALL) // 2], BALL[:-1]])
def test_a_damaged_model_is_refused_with_the_reason(content):
    with pytest.raises(ModelError, match=r"model\.onnx: "):
        proved(content)


def test_a_model_that_needs_too_much_memory_is_refused():
    with pytest.raises(ModelError, match=r"model\.onnx: .*(can't run it|proof)"):
        proved(huge())


@pytest.mark.long
def test_a_model_without_end_is_refused_and_its_process_has_no_rights_and_is_ended():
    seen, others = [], children()  # others: such as the process of tests/preloaded.py
    without_rights = os.geteuid() == 0 and modules_are_public()

    def look():
        while not seen:
            for each in children():
                status = Path(f"/proc/{each}/status").read_text()
                limits = Path(f"/proc/{each}/limits").read_text()
                if "Max open files            64 " in limits and ("Uid:\t65534" in status or not without_rights):
                    seen.append((status, limits))
            time.sleep(0.01)

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    with pytest.raises(ModelError, match=r"proof takes (longer than|more than)"):
        proved(endless())
    assert children() == others
    looking.join(10.0)
    status, limits = seen[0]  # of a process that is nobody's, if this one is root
    assert "Max file size             0 " in limits
    assert "Max core file size        0 " in limits
    assert "Max address space         unlimited" not in limits
    if without_rights:
        assert "Uid:\t65534\t65534\t65534\t65534" in status
        assert "Gid:\t65534\t65534\t65534\t65534" in status


@pytest.mark.long
def test_attack_3_check_config_refuses_a_model_without_end(tmp_path):
    path = tmp_path / "model.onnx"
    path.write_bytes(endless())
    done = subprocess.run(
        arguments(tmp_path, "--check-config", "--model", path), capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "proof takes" in done.stderr


SPY = """
import os
import socket
import onnxruntime

class Session(onnxruntime.InferenceSession):
    def __init__(self, *words, **more):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as told:
            told.sendto(f"{os.getuid()} {os.getpid()}".encode(), os.environ["SESSIONS"].replace("@", chr(0)))
        super().__init__(*words, **more)

onnxruntime.InferenceSession = Session
"""
"""A module that Python imports at its start: it tells who runs a network, and then runs it."""


@pytest.mark.long
@pytest.mark.parametrize("command", [("vm-detect", "--check-config"), ("vm-doctor",)])
def test_attack_11_the_process_that_checks_a_model_never_runs_it(tmp_path, command):
    """As root, what vm-deploy and install.sh start would otherwise run a network of an enemy with all rights."""
    (tmp_path / "sitecustomize.py").write_text(SPY)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(f"\0{tmp_path}")  # an abstract address, which needs no rights
        line = [COMMAND.with_name(command[0]), *command[1:], "--camera", "synthetic"]
        environment = os.environ | {"SESSIONS": f"@{tmp_path}", "PYTHONPATH": path}
        with subprocess.Popen(line, env=environment, stdout=subprocess.PIPE, text=True) as process:
            said = process.communicate(timeout=120)[0]
        heard.setblocking(False)
        sessions = []
        with suppress(BlockingIOError):
            while True:
                sessions.append(heard.recv(100).decode().split())
    assert "self-test passed" in said
    assert sessions
    assert str(process.pid) not in [pid for _, pid in sessions]
    if os.geteuid() == 0 and modules_are_public():
        assert {uid for uid, _ in sessions} == {"65534"}


@pytest.mark.long
def test_attack_3_frames_and_signals_go_on_while_a_new_model_is_proved(tmp_path):
    path, model = tmp_path / "vm.toml", tmp_path / "model.onnx"
    text = 'model = "{}"\n[camera]\nsource = "synthetic"\n'
    path.write_text(text.format("ball"))
    model.write_bytes(endless())
    with running(tmp_path, "--config", path) as found:
        found.wait_for_state("ok")
        path.write_text(text.format("model.onnx"))
        found.process.send_signal(signal.SIGHUP)
        started = len(found.frames)
        found.wait(lambda: len(found.frames) > started + 20)
        status, seconds = found.stop()
        assert status == 0
        assert seconds < 5.0
    assert not [each for each in found.events if each["event"] in ("reloaded", "reload refused")]


@pytest.mark.long
def test_attack_3_a_frame_that_hangs_ends_the_detector_with_state_and_status(tmp_path):
    model = tmp_path / "model.onnx"
    model.write_bytes(endless_on_many_points())
    with running(tmp_path, "--camera", "synthetic", "--model", model) as found:
        status = found.process.wait(120)
        for each in found._threads:
            each.join(60)
    assert status == EXIT_RESTART
    assert found.frames == []
    assert found.messages[-1]["state"] == "stopping"
    assert "a frame takes more than 8 s" in found.messages[-1]["reason"]
    last = found.events[-1]
    assert (last["event"], last["level"]) == ("stopped", "error")


@pytest.mark.long
def test_a_detector_that_was_stopped_for_long_does_not_count_as_hanging(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        found.process.send_signal(signal.SIGSTOP)
        time.sleep(FrameWatchdog.limit + 1.0)
        before = len(found.frames)
        found.process.send_signal(signal.SIGCONT)
        found.wait(lambda: len(found.frames) > before + 5)
        assert found.stop()[0] == 0
