"""A running detector whose pose is wrong says so: in messages, log, metrics and on the status page. Real frames."""

import cv2
import pytest

from tests.vm_embedded.cli.test_wrong_poses import RADIUS, camera, right
from tests.waiting import wait
from vm_embedded.live.control import ask

from .running import running
from .test_status_page import free_address

__all__ = ("camera",)  # a fixture


@pytest.fixture
def film(camera, tmp_path):
    """The options for a film of these frames that plays again and again."""
    frames, lens, pose = camera
    path = tmp_path / "film.avi"
    pictures = [cv2.imread(str(each)) for each in sorted(frames.iterdir())]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, pictures[0].shape[1::-1])
    for each in pictures:
        writer.write(each)
    writer.release()
    return ("--camera", path, "--live", "--camera-loop", "--lens", lens, "--model", "soccer", *RADIUS), pose


@pytest.mark.long
def test_a_pitch_that_is_six_degrees_off_is_reported(film, browser, tmp_path):
    options, pose = film
    *height, _, roll = right(pose)
    where = free_address()
    with running(tmp_path, *options, *height, "--pitch=-8deg", roll, "--status-page", where) as found:
        found.wait(lambda: any(each["pose"]["verdict"] == "wrong" for each in found.frames))
        found.wait(lambda: any(each["event"] == "wrong pose" for each in list(found.events)))
        (reason, *_) = [each["reason"] for each in found.events if each["event"] == "wrong pose"]
        assert "the camera seems to look" in reason
        assert "lower" in reason
        assert "try --pitch" in reason
        lines = ask(tmp_path / "control", "metrics").splitlines()
        assert 'vm_pose{pose="wrong"} 1' in lines
        assert next(float(each.split()[1]) for each in lines if each.startswith("vm_pose_pitch_error_degrees")) > 2.0
        browser.get(f"http://{where}/")
        wait(lambda: browser.find_element("id", "doubt").text == "pose wrong")
        wait(lambda: "pitch, roll off by" in browser.find_element("id", "runs").text)
        wait(lambda: browser.execute_script("return document.getElementById('picture').naturalWidth") > 0)
        browser.save_screenshot(str(tmp_path / "page.png"))
        found.stop()
