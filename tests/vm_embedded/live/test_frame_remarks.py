"""What a daemon says about frames that show no mesh point, and about a lens that is probably wrong."""

import json
import socket
import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from tests.vm_embedded.live.running import DEMO, running
from vm_embedded.cameras.camera import Shot
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_embedded.live.answering import Answer
from vm_embedded.live.frame_remarks import FrameRemarks


@pytest.fixture
def film(tmp_path):
    """The options for a video that plays again and again, with lens but without pose."""
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (640, 512))
    for each in sorted(DEMO.glob("image*.jpg")):
        writer.write(cv2.imread(str(each)))
    writer.release()
    return ("--camera", path, "--live", "--camera-loop", "--fov", "70deg")


def remarks(found, event):
    return [each["reason"] for each in list(found.events) if each["event"] == event]


@pytest.mark.long
def test_a_height_in_centimeters_degrades_it(tmp_path, film):
    with running(tmp_path, *film, "--height", 80, "--pitch", "20deg") as found:
        found.wait_for_state("degraded")
        found.wait(lambda: len(found.frames) > 10)
        found.stop()
    assert "ok" not in found.states
    reason = next(each["reason"] for each in found.events if each.get("state") == "degraded")
    assert reason == ("the camera's height is 80 m, but the mesh ends at a distance of 6 m: heights are in meters")


@pytest.mark.long
def test_so_do_poses_in_centimeters_until_they_are_right(tmp_path, film):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = free.getsockname()
    source = ("--pose-source", f"udp:{address[0]}:{address[1]}", "--pose-clock", "arrival")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, running(tmp_path, *film, *source) as found:

        def reaches(state, height):
            line = json.dumps({"height": height, "quaternion": [0.98481, 0.0, 0.17365, 0.0]})
            sender.sendto(line.encode(), address)
            return found.frames and found.frames[-1]["state"] == state

        found.wait(lambda: reaches("degraded", 80.0))
        time.sleep(0.3)  # after such a gap, any height is accepted
        found.wait(lambda: reaches("ok", 0.8))
        found.stop()
    assert "heights are in meters" in next(each["reason"] for each in found.events if each.get("state") == "degraded")


@pytest.mark.long
def test_a_camera_that_looks_up_stays_ok_and_the_log_says_once_that_it_sees_nothing(tmp_path, film):
    with running(tmp_path, *film, "--height", 0.8, "--pitch=-80deg") as found:
        found.wait_for_state("ok")
        (reason,) = found.wait(lambda: remarks(found, "plane not in view"))
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 10)
        found.stop()
    assert "pitch (down is above 0)" in reason
    assert len(remarks(found, "plane not in view")) == 1
    assert "degraded" not in found.states


@pytest.mark.long
def test_a_lens_in_millimeters_is_said_once(tmp_path, film):
    (tmp_path / "lens.yaml").write_text("projection: RECTILINEAR\nfocal_length: 3.6\nfov: 1.66\n")
    options = (*film[:-2], "--lens", tmp_path / "lens.yaml", "--height", 0.8, "--pitch", "20deg")
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 10)
        found.stop()
    (reason,) = remarks(found, "doubtful lens")
    assert "a circle of 7.86 px in a picture of 640 x 512 px" in reason


def test_a_robot_that_has_seen_the_plane_may_look_up():
    lens = Rectilinear(focal_length=400.0, fov=1.5)
    image = np.zeros((512, 640, 3), np.uint8)

    def events(*points):
        """The events of answers a second apart that have so many points."""
        watch = FrameRemarks()
        shot, shown = Shot(image, 0.0), [SimpleNamespace(pixels=range(count), pose=None) for count in points]
        found = [watch.about(Answer(shot, lens, None, each, 7.0 + at)) for at, each in enumerate(shown)]
        return [event for each in found for event, _ in each]

    assert events(*[0] * 20) == ["plane not in view"]
    assert events(*[0] * 5, 9, *[0] * 20) == []
    assert events(9, *[0] * 20) == []


@pytest.mark.parametrize("distortion", [(0.0, 0.0), (1e-7, 0.0)])
@pytest.mark.parametrize("topic", ["/camera/image_raw", "/camera/image_rect", "/image_rect_color/compressed"])
def test_a_raw_lens_on_a_topic_of_rectified_images_is_said(topic, distortion):
    lens = Rectilinear(focal_length=400.0, fov=1.5, distortion=distortion)
    shot = Shot(np.zeros((512, 640, 3), np.uint8), 0.0, topic=topic)
    found = list(FrameRemarks().about(Answer(shot, lens, None, SimpleNamespace(pixels=range(9), pose=None), 7.0)))
    assert [event for event, _ in found] == ["doubtful lens"] * ("rect" in topic and distortion[0] > 0.0)
    assert all(topic in reason for _, reason in found)
