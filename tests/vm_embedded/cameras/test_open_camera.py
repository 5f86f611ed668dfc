"""Which names are live cameras, and which can never work."""

import pytest

from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.open_camera import camera_opener, is_live
from vm_embedded.errors import InputError


def test_names_of_cameras():
    for live in (
        "0",
        "/dev/video0",
        "http://a/b",
        "rtsp://a/b",
        "synthetic",
        "synthetic:2",
        "fault:a",
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
