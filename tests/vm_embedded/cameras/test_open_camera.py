"""Which names are live cameras, and which can never work."""

import os
from contextlib import contextmanager

import pytest

from tests.preloaded import run_preloaded
from tests.vm_embedded.live.running import COMMAND
from vm_embedded.cameras import opencv
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.image_files import open_sources
from vm_embedded.cameras.open_camera import camera_opener, is_live
from vm_embedded.cameras.ros.bags import is_bag
from vm_embedded.errors import InputError


def test_names_of_cameras():
    for live in (
        "0",
        "/dev/video0",
        "http://a/b",
        "rtsp://a/b",
        "synthetic",
        "synthetic:2",
        "gstreamer:x ! y",
    ):
        assert is_live(live)
    for file in ("a.mp4", "frames", "frames/*.jpg", "./0"):
        assert not is_live(file)
    for wrong in ("nothing", "synthetic:fast", "synthetic:nan", "http://", "http://a:b/"):
        with pytest.raises(InputError):
            camera_opener(CameraSettings(source=wrong))
    with pytest.raises(InputError, match=r"^camera rtsp://a/b delivers colors: it supports only --format bgr$"):
        camera_opener(CameraSettings(source="rtsp://a/b"), raw=True)
    with pytest.raises(InputError, match=r"unknown protocol 'rstp'.*allowed: http, https, rtsp"):
        camera_opener(CameraSettings(source="rstp://a/b"))


LONG = 300 * "x"
"""No file system has names of 300 letters."""


@pytest.mark.parametrize(
    ("options", "status", "says"),
    [
        (("--live", "--camera", LONG), 78, "no such camera"),
        (("--camera", f"/dev/{LONG}"), 78, "File name too long"),
        (("--camera", LONG), 1, "can't read xxx"),
        ((LONG, LONG), 1, "can't read xxx"),
        ((f"{LONG}.mcap",), 1, "can't read bag xxx"),
    ],
)
def test_a_name_that_is_too_long_is_one_line(options, status, says):
    done = run_preloaded([COMMAND, *options])
    assert done.returncode == status
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


@contextmanager
def without_rights(folder):
    """Nothing in this folder can be looked at."""
    user = os.geteuid()
    folder.chmod(0)
    if user == 0:
        os.seteuid(65534)  # root may look at everything
    try:
        yield
    finally:
        os.seteuid(user)
        folder.chmod(0o700)


def test_a_camera_in_a_folder_that_this_user_may_not_enter_is_refused(tmp_path, monkeypatch):
    file = str(tmp_path / "frames.mp4")
    with without_rights(tmp_path):
        assert not is_live(file)
        assert not is_bag(file)
        with pytest.raises(InputError, match="no such camera"):
            camera_opener(CameraSettings(source=file))
        with pytest.raises(InputError, match="Permission denied"):
            open_sources([file, file])
        monkeypatch.setattr(opencv, "device_path", lambda source: tmp_path / "video0")
        with pytest.raises(InputError, match="Permission denied"):
            opencv.check_opencv_settings(CameraSettings(source="/dev/video0"))
