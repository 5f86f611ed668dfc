"""Video files that are played as a camera would deliver them."""

import subprocess
import time

import cv2
import numpy as np
import pytest

from tests.messages import read_message
from tests.vm_embedded.live.running import DEMO, LENS, arguments, running
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.grabber import same_image
from vm_embedded.cameras.open_camera import camera_opener
from vm_embedded.cameras.synthetic import SIZE, SyntheticCamera


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


def test_files_may_be_played_as_a_camera_gives_them_and_end(tmp_path):
    lens = ("--lens", DEMO / "lens0000000.yaml", "--height", "0.6")
    options = ("--camera", DEMO, "--live", "--camera-fps", "20", *lens)
    started = time.monotonic()
    done = subprocess.run(arguments(tmp_path, *options), capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - started > 12 / 20
    frames = [read_message(line) for line in done.stdout.splitlines()]
    assert 0 < sum(each["type"] == "frame" for each in frames) <= 12
