"""vm-detect on a live camera: a real process, its messages, states and signals."""

import os
import signal
import socket
import stat
import time

import numpy as np
import pytest

from tests.messages import read_message
from tests.preloaded import run_preloaded
from tests.soak.failing_camera import Fault
from tests.vm_embedded.live.running import DEMO, arguments, counts, running
from vm_embedded.cameras.synthetic import Motion
from vm_embedded.network.bundled import model_path


def test_a_drawn_camera_is_watched_and_its_ball_is_where_it_is(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        found.wait(lambda: sum(len(each["detections"]) for each in found.frames) > 10)
        status, seconds = found.stop()
    assert status == 0
    assert seconds < 1.0
    assert found.states[0] == "starting"
    assert found.states[-1] == "stopping"
    errors = []
    for each in found.frames:
        assert 0.0 < each["age_ms"] < 250.0
        for ball in each["detections"][:1]:
            truth = Motion().ball(each["t"])
            errors.append(np.linalg.norm(ball["position"] - truth) / np.linalg.norm(truth))
    assert np.median(errors) < 0.05
    numbers = [each["frame"] for each in found.frames]
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_and_its_sockets_are_gone(tmp_path, number):
    with running(tmp_path, "--camera", "synthetic", "--output-unix", tmp_path / "lines") as found:
        found.wait_for_state("ok")
        for name in ("lines", "control"):
            assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o660
        status, seconds = found.stop(number)
    assert status == 0
    assert seconds < 1.0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_systemd_hears_that_it_is_ready_how_it_is_and_that_it_lives(tmp_path):
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(path))
        listening.settimeout(30.0)
        env = {"NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": "400000"}
        with running(tmp_path, "--camera", "synthetic", env=env) as found:
            heard = []
            while heard.count("WATCHDOG=1") < 5 or "STATUS=ok" not in heard:
                heard += listening.recv(4096).decode().split("\n")
            found.stop()
            listening.settimeout(1.0)
            while "STOPPING=1" not in heard:
                heard += listening.recv(4096).decode().split("\n")
    assert heard.count("READY=1") == 1
    assert heard.index("READY=1") < heard.index("STATUS=ok")


@pytest.mark.long
def test_a_camera_that_is_not_there_yet_is_waited_for(tmp_path):
    pose = ("--lens", DEMO / "lens0000000.yaml", "--height", 0.6)
    with running(tmp_path, "--camera", "/dev/video-none", "--camera-retry-ms", "20", *pose) as found:
        found.wait_for_state("camera_lost")
        found.wait(lambda: any(each.get("reason", "").startswith("there is no camera") for each in found.messages))
        found.wait(lambda: counts(tmp_path)["reconnects"] > 2)
        asked = run_preloaded(arguments(tmp_path, "--status"))
        assert asked.returncode == 1
        assert read_message(asked.stdout)["state"] == "camera_lost"
        assert found.stop()[0] == 0
    assert found.frames == []


@pytest.mark.long
def test_frames_that_are_late_because_of_their_detection_say_what_to_change(tmp_path):
    # A tiny ball needs a mesh with many points: the detection takes longer than a busy core keeps a frame waiting.
    slow = ("--object-radius", 0.008, "--camera-max-age-ms", 100)
    with running(tmp_path, "--camera", "synthetic", *slow) as found:
        found.wait(lambda: any("its detection took" in each.get("reason", "") for each in found.messages))
        found.stop()


def test_hangup_reads_the_configuration_again_and_keeps_the_old_one_if_it_is_bad(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_text('[camera]\nsource = "synthetic"\n[detector]\nthreshold = 0.5\n')
    with running(tmp_path, "--config", path) as found:
        found.wait_for_state("ok")
        path.write_text("[detector]\ntreshold = 0.6\n")
        found.process.send_signal(signal.SIGHUP)
        refused = found.wait(lambda: [each for each in found.events if each["event"] == "reload refused"])
        assert "line 2" in refused[0]["reason"]
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 5)
        assert not any("track" in each for frame in found.frames for each in frame["detections"])
        path.write_text('model = "ball"\n[camera]\nsource = "synthetic"\n[track]\non = true\n')
        found.process.send_signal(signal.SIGHUP)
        found.wait(lambda: [each for each in found.events if each["event"] == "reloaded"])
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 5)
        found.wait(lambda: any("track" in each for each in found.frames[-1]["detections"]))
        found.stop()


@pytest.mark.long
def test_hangup_refuses_files_that_may_never_end(tmp_path):
    path, model, pipe = (tmp_path / each for each in ("vm.toml", "model.onnx", "pipe"))
    model.symlink_to(model_path("ball"))
    path.write_text(f'model = "{model}"\n[camera]\nsource = "synthetic"\n')
    os.mkfifo(pipe)
    with running(tmp_path, "--config", path) as found:
        found.wait_for_state("ok")
        for name in (model, path):
            name.unlink()
            name.symlink_to(pipe)
            found.process.send_signal(signal.SIGHUP)
            says = f"{name}: not a regular file"
            found.wait(lambda says=says: any(says in each.get("reason", "") for each in list(found.events)))
        assert found.stop()[0] == 0


@pytest.mark.long
def test_a_second_signal_ends_it_at_once(tmp_path):
    kept = tmp_path / "recordings"
    with running(tmp_path, "--recorder-folder", kept, faults=[Fault("hang", at=1.0, seconds=60.0)]) as found:
        found.wait_for_state("camera_lost")
        for _ in range(2):
            found.process.send_signal(signal.SIGTERM)
        started = time.monotonic()
        assert found.process.wait(30) in (0, 1)
        assert time.monotonic() - started < 1.0
