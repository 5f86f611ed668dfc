"""Newest frames first, and no waiting: shown on real processes."""

import cv2
import numpy as np
import pytest

from tests.vm_embedded.live.running import counts, running
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera

LENS = '[lens]\nprojection = "rectilinear"\nfocal_length = 224\nfov = 1.75\n[orientation]\nheight = 0.8\npitch = 0.4\n'


@pytest.fixture
def video(tmp_path):
    """Twenty small pictures, 200 a second."""
    camera = SyntheticCamera(CameraSettings(width=320, height=256))
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 200.0, (320, 256))
    for at in range(20):
        writer.write(camera.draw(at / 30.0))
    writer.release()
    return path


@pytest.mark.long
def test_a_detector_five_times_slower_than_its_camera_works_on_the_newest_frame(tmp_path, video):
    (tmp_path / "vm.toml").write_text(LENS)
    # A tiny ball needs a mesh with many points: the detector takes a tenth of a second, on a busy core much more.
    slow = ("--camera-loop", "--live", "--object-radius", 0.008, "--camera-max-age-ms", 10000)
    with running(tmp_path, "--config", tmp_path / "vm.toml", "--camera", video, *slow) as found:
        found.wait(lambda: len(found.frames) > 40)
        counted = counts(tmp_path)
        found.stop()
    assert counted["grabbed"] > 5 * counted["frames"]
    assert counted["skipped"] > 4 * counted["frames"]
    frames = found.frames[10:]
    assert (np.diff([each["t"] for each in frames]) > 0).all()
    # When its turn came, a frame had waited for less than two others to come: the detector never falls behind.
    waited = [each["latency_ms"] - each["timing_ms"]["total"] for each in frames]
    took = np.median([each["timing_ms"]["total"] for each in frames])
    assert np.median(waited) < 0.5 * took


@pytest.mark.long
def test_a_message_leaves_soon_after_its_frame(tmp_path, video):
    (tmp_path / "vm.toml").write_text(LENS)
    played = ("--live", "--camera-loop", "--camera-fps", 30)
    with running(tmp_path, "--config", tmp_path / "vm.toml", "--camera", video, *played) as found:
        found.wait(lambda: len(found.frames) > 200)
        found.stop()
    frames = found.frames[50:]
    took = np.median([each["latency_ms"] for each in frames])
    detector = np.median([each["timing_ms"]["total"] for each in frames])
    print(f"from frame to message {took:.2f} ms, detector {detector:.2f} ms")
    assert took < 2.0 * detector
