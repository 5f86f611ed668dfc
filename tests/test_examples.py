"""The examples of docs/examples, run as their first lines say. tests/deploy/test_cpp.py runs behavior.cpp."""

import re
import socket
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.vm_embedded.live.running import DEMO, counts, running
from vm_embedded import Orientation
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import Motion, SyntheticCamera

CHECKOUT = Path(__file__).parents[1]
EXAMPLES = CHECKOUT / "docs" / "examples"


def run_example(name, *arguments):
    command = [sys.executable, EXAMPLES / name, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_each_example_has_a_test_and_is_described():
    tests = "".join(path.read_text() for path in CHECKOUT.glob("tests/**/test_*.py"))
    page = (CHECKOUT / "docs" / "examples.md").read_text()
    names = [path.name for path in EXAMPLES.iterdir() if path.is_file()]
    assert len(names) >= 4
    for name in names:
        assert f'"{name}"' in tests, f"no test runs {name}"
        assert f"(examples/{name})" in page, f"docs/examples.md does not describe {name}"


def test_the_balls_of_a_picture(tmp_path):
    copy = tmp_path / "found.jpg"
    printed = run_example("picture.py", DEMO / "image0000002.jpg", DEMO / "lens0000002.yaml", copy)
    assert printed
    pattern = r"ball (0\.\d\d|1\.00): -?\d\.\d\d m ahead, -?\d\.\d\d m to the left"
    assert all(re.match(pattern, line) for line in printed)
    assert cv2.imread(str(copy)).shape == cv2.imread(str(DEMO / "image0000002.jpg")).shape


class Still(Motion):
    """A ball that rolls in front of a camera that stands still."""

    def orientation(self, time):
        return Orientation.from_roll_pitch(0.8, pitch=0.4)


def test_a_camera_that_stands_still(tmp_path):
    camera = SyntheticCamera(CameraSettings(source="synthetic:0"))
    camera.motion = Still(0.0)
    film = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, camera.size)
    for number in range(10):
        writer.write(camera.draw(0.1 * number))
    writer.release()
    lens = tmp_path / "lens.toml"
    lens.write_text('projection = "rectilinear"\nfocal_length = 448\nfov = 1.75\nsize = [640, 512]\n')
    printed = run_example("camera.py", film, lens, 0.8, np.degrees(0.4))
    found = [re.fullmatch(r"([\d.]+) s: ball 1 at \((.*), (.*)\) m, ([\d.]+) m/s", line) for line in printed]
    assert len(found) == 10
    time, x, y, speed = map(float, found[-1].groups())
    assert time == pytest.approx(0.9)
    assert np.hypot(*(np.array([x, y]) - Motion(0.0).ball(time)[:2])) < 0.1
    assert speed == pytest.approx(np.linalg.norm(Motion(0.0).ball(0.95) - Motion(0.0).ball(0.85)) / 0.1, abs=0.3)


@pytest.mark.long
def test_poses_over_udp(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    with running(tmp_path, "--camera", "synthetic", "--pose-source", f"udp:{address}") as found:
        found.wait_for_state("pose_stale")
        with subprocess.Popen([sys.executable, EXAMPLES / "poses_udp.py", address]) as sending:
            try:
                found.wait_for_state("ok")
                found.wait(lambda: sum(len(each["detections"]) for each in found.frames) > 5)
                counted = counts(tmp_path)
            finally:
                sending.kill()
        found.stop()
    assert counted["poses"] > 10
    assert counted["poses_bad"] == 0
    off = [
        np.linalg.norm(ball["position"] - Motion().ball(each["t"]))
        for each in found.frames
        for ball in each["detections"][:1]
    ]
    assert np.median(off) < 0.2  # the example has the poses of the synthetic camera, but for a small roll
