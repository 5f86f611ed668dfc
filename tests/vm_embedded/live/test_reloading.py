"""What a reload refuses, before it changes anything."""

import asyncio
import os
import platform
import signal
from dataclasses import replace

import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import running
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.errors import InputError
from vm_embedded.live.configuration import Configuration, FixedPose
from vm_embedded.live.control import ask
from vm_embedded.live.reloading import read_again
from vm_embedded.output.recorder import RecorderSettings
from vm_embedded.poses.settings import PoseSettings

RUNNING = Configuration(
    camera=CameraSettings(source="rtsp://10.0.0.7/1"), fov=1.0, orientation=FixedPose(height=0.5, pitch=0.2)
)


def refusal(wanted):
    with pytest.raises(InputError) as error:
        asyncio.run(read_again(lambda: wanted, RUNNING))
    return str(error.value)


def test_a_configuration_that_works_only_after_a_restart_is_refused():
    """Its pose stream would replace the fixed pose, but a reload keeps the running one."""
    wanted = Configuration(camera=RUNNING.camera, fov=1.0, pose=PoseSettings(source="udp:0.0.0.0:5600"))
    said = refusal(wanted)
    assert "needs poses" in said
    assert said.endswith("(only a restart changes pose)")


def test_a_camera_that_would_not_start_is_refused():
    assert "needs a lens" in refusal(Configuration(camera=CameraSettings(source="rtsp://10.0.0.8/1")))


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ({"camera": CameraSettings()}, "no camera"),
        ({"camera": CameraSettings(source="ros")}, "works only with vm-ros"),
        ({"camera": CameraSettings(source="none.mp4")}, "no such camera"),
        ({"pose": PoseSettings(source="tf")}, "works only with vm-ros"),
        ({"recorder": RecorderSettings(trigger_class="zzz")}, "[recorder] trigger_class: unknown class 'zzz'"),
    ],
)
def test_what_the_next_start_would_refuse_is_refused(section, says):
    assert says in refusal(replace(RUNNING, **section))


FAULT = """
import sys

if sys.orig_argv[1].endswith("vm-detect"):
    from vm_embedded.live import daemon

    read_again = daemon.read_again

    async def fail_once(*given):
        daemon.read_again = read_again
        raise RuntimeError("the reader is broken")

    daemon.read_again = fail_once
"""
"""A module that Python imports at its start."""


@pytest.mark.long
def test_a_reload_that_fails_in_an_unknown_way_says_so(tmp_path):
    (tmp_path / "sitecustomize.py").write_text(FAULT)
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    with running(tmp_path, "--camera", "synthetic", env={"PYTHONPATH": path}) as found:
        found.wait_for_state("ok")
        found.process.send_signal(signal.SIGHUP)
        refused = found.wait(lambda: [each for each in found.events if each["event"] == "reload refused"])
        assert refused[0]["reason"] == "the reader is broken"
        found.process.send_signal(signal.SIGHUP)
        found.wait(lambda: [each for each in found.events if each["event"] == "reloaded"])
        assert found.stop()[0] == 0


@pytest.mark.long
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have no malloc_trim")
def test_a_network_that_was_replaced_leaves_no_memory_behind(tmp_path):
    def memory_after_reload(number):
        found.process.send_signal(signal.SIGHUP)
        found.wait(lambda: sum(each["event"] == "reloaded" for each in found.events) == number)
        frames = len(found.frames)
        found.wait(lambda: len(found.frames) > frames + 10)
        return read_message(ask(tmp_path / "control", "status"))["memory_mib"]

    with running(tmp_path, "--camera", "synthetic", "--model", "soccer") as found:
        found.wait_for_state("ok")
        mib = [memory_after_reload(number) for number in range(1, 9)]
        found.stop()
    assert mib[-1] < mib[0] + 50.0
