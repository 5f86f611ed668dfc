"""Video files that are played as a camera would deliver them."""

import time

import cv2
import numpy as np
import pytest

from tests.messages import read_message
from tests.preloaded import run_preloaded
from tests.vm_embedded.live.running import COMMAND, DEMO, LENS, arguments, running
from vm_embedded.cameras import image_files, video_files
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.grabber import same_image
from vm_embedded.cameras.open_camera import camera_opener
from vm_embedded.cameras.synthetic import SIZE, SyntheticCamera
from vm_embedded.errors import InputError


@pytest.mark.long
def test_a_video_is_played_at_its_rate_again_and_again(tmp_path):
    camera = SyntheticCamera(CameraSettings())
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    assert writer.isOpened()
    for at in range(10):
        writer.write(camera.draw(at / 25.0))
    writer.release()
    opened = camera_opener(CameraSettings(source=str(path), loop=True))()
    shots = [opened.read() for _ in range(25)]
    opened.close()
    times = np.diff([each.captured for each in shots])
    assert np.median(times) == pytest.approx(1 / 25.0, rel=0.02)
    assert same_image(shots[0].image, shots[10].image)
    assert not same_image(shots[0].image, shots[1].image)
    (tmp_path / "vm.toml").write_text(LENS)
    with running(tmp_path, "--config", tmp_path / "vm.toml", "--camera", path, "--live", "--camera-loop") as found:
        found.wait(lambda: len(found.frames) > 15)
        found.stop()
    with running(tmp_path, "--config", tmp_path / "vm.toml", "--camera", path, "--live") as found:
        assert found.process.wait(60) == 0
    assert 0 < len(found.frames) <= 10


@pytest.fixture
def video(tmp_path):
    """A video of three frames."""
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    for at in range(3):
        writer.write(SyntheticCamera(CameraSettings()).draw(at / 25.0))
    writer.release()
    return path


@pytest.mark.long
def test_attack_2_a_video_of_large_frames_is_refused(video, tmp_path):
    options = (video, "--camera-max-megapixels", "0.1", "--fov", "70deg", "--height", "0.6")
    done = run_preloaded([COMMAND, *options])
    assert done.returncode == 1
    assert done.stdout == ""
    assert f"{video} has 640 x 512 px" in done.stderr
    assert done.stderr.count("\n") == 1
    with running(tmp_path, *options, "--live") as found:
        found.wait_for_state("camera_lost")
        found.wait(lambda: any("has 640 x 512 px" in each.get("reason", "") for each in found.messages))
        found.stop()
    assert found.frames == []


def test_attack_2_a_frame_larger_than_the_video_said_is_left_out(monkeypatch, video):
    monkeypatch.setattr(video_files, "check_video", lambda *given: None)
    frames = list(image_files.open_source(str(video), max_megapixels=0.1).frames)
    assert len(frames) == 3
    with pytest.raises(InputError, match=r"frame of field\.avi has 640 x 512 px"):
        frames[0].read()


@pytest.mark.long
def test_files_may_be_played_as_a_camera_gives_them_and_end(tmp_path):
    lens = ("--lens", DEMO / "lens0000000.yaml", "--height", "0.6")
    options = ("--camera", DEMO, "--live", "--camera-fps", "20", *lens)
    started = time.monotonic()
    done = run_preloaded(arguments(tmp_path, *options))
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - started > 12 / 20
    frames = [read_message(line) for line in done.stdout.splitlines()]
    assert 0 < sum(each["type"] == "frame" for each in frames) <= 12
