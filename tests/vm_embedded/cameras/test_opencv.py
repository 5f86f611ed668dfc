"""What is asked of a device, and what is believed of its frames, with a capture that stands in for one."""

import socket
import threading
import time
from contextlib import ExitStack, contextmanager

import cv2
import numpy as np
import pytest

from vm_embedded.cameras import opencv as camera_opencv
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings
from vm_embedded.cameras.opencv import OpenCvCamera, check_opencv_settings, device_path
from vm_embedded.cameras.synthetic import SIZE, SyntheticCamera
from vm_embedded.errors import InputError


class Capture:
    """A cv2.VideoCapture of a device that gives Motion JPEG."""

    made = None

    def __init__(self, *arguments):
        type(self).made = self
        self.arguments, self.asked = arguments, {}
        self.frames = iter(())
        self.stamp = 0.0

    def isOpened(self):
        return True

    def set(self, name, value):
        self.asked[name] = value
        return True

    def get(self, name):
        known = {cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*"MJPG"), cv2.CAP_PROP_POS_MSEC: 1e3 * self.stamp}
        return known.get(name, 0.0)

    def read(self):
        frame = next(self.frames, None)
        return frame is not None, frame

    def release(self):
        self.asked["released"] = True


@pytest.fixture
def device(tmp_path, monkeypatch):
    """A node, and the capture that opens it."""
    node = tmp_path / "video0"
    node.write_text("")
    monkeypatch.setattr(camera_opencv, "device_path", lambda source: node)
    monkeypatch.setattr(camera_opencv.cv2, "VideoCapture", Capture)
    return node


def jpeg(at=0.0):
    content = cv2.imencode(".jpg", SyntheticCamera(CameraSettings()).draw(at))[1]
    return content.reshape(1, -1)


def test_a_device_is_asked_for_what_is_configured(device):
    settings = CameraSettings(
        source="0", pixel_format="MJPG", width=1280, height=1024, fps=60, exposure_ms=5.0, gain=20
    )
    OpenCvCamera(settings).close()
    asked = Capture.made.asked
    assert Capture.made.arguments == (str(device), cv2.CAP_V4L2)
    assert asked[cv2.CAP_PROP_FOURCC] == cv2.VideoWriter.fourcc(*"MJPG")
    assert (asked[cv2.CAP_PROP_FRAME_WIDTH], asked[cv2.CAP_PROP_FRAME_HEIGHT], asked[cv2.CAP_PROP_FPS]) == (
        1280,
        1024,
        60,
    )
    assert (asked[cv2.CAP_PROP_AUTO_EXPOSURE], asked[cv2.CAP_PROP_EXPOSURE]) == (1, 50)
    assert (asked[cv2.CAP_PROP_GAIN], asked[cv2.CAP_PROP_BUFFERSIZE]) == (20, 1)
    assert asked["released"]


def test_what_is_not_configured_is_left_to_the_device(device):
    OpenCvCamera(CameraSettings(source="0"))
    assert set(Capture.made.asked) == {cv2.CAP_PROP_BUFFERSIZE, cv2.CAP_PROP_CONVERT_RGB}


def test_jpegs_of_a_device_are_kept_as_they_came_and_half_ones_are_refused(device):
    camera = OpenCvCamera(CameraSettings(source="0"))
    whole = jpeg()
    Capture.made.frames = iter([whole, whole[:, : whole.size // 2], whole])
    shot = camera.read()
    assert shot.encoded == whole.tobytes()
    assert shot.image.shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(BrokenFrameError, match="cut short"):
        camera.read()
    assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(CameraError, match="delivers no frames"):
        camera.read()


def test_the_device_s_own_time_is_believed_only_where_it_can_be_true(device):
    camera = OpenCvCamera(CameraSettings(source="0", latency_ms=30))
    whole = jpeg()
    Capture.made.frames = iter([whole] * 10)

    def captured(stamp):
        Capture.made.stamp = stamp
        return camera.read().captured

    good = time.monotonic() - 0.02
    assert captured(good) == pytest.approx(good, abs=1e-6)
    for wrong in (good, good - 0.5, good + 3600.0, good - 3600.0, time.time()):
        before = time.monotonic()
        assert before - 0.0301 <= captured(wrong) <= time.monotonic() - 0.0299


def test_a_node_that_is_gone_ends_it_although_frames_go_on(device):
    camera = OpenCvCamera(CameraSettings(source="0"))
    Capture.made.frames = iter([jpeg()] * 3)
    camera.read()
    device.unlink()
    with pytest.raises(CameraError, match="was unplugged"):
        camera.read()
    with pytest.raises(CameraError, match="there is no camera at"):
        OpenCvCamera(CameraSettings(source="0"))


def test_an_address_is_read_through_ffmpeg(tmp_path):
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    for at in range(3):
        writer.write(SyntheticCamera(CameraSettings()).draw(at / 25.0))
    writer.release()
    camera = OpenCvCamera(CameraSettings(source=f"file://{path}"))
    assert all(camera.read().image.shape == (SIZE[1], SIZE[0], 3) for _ in range(3))
    with pytest.raises(CameraError):
        camera.read()
    camera.close()
    with pytest.raises(CameraError, match="can't open"):
        OpenCvCamera(CameraSettings(source=f"file://{tmp_path / 'none.avi'}"))


@contextmanager
def stream(path, pause=0.0):
    """The address of a stream of six frames, whose last one never arrives. pause: before it begins [s]."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FMP4"), 25.0, SIZE)
    for at in range(6):
        writer.write(SyntheticCamera(CameraSettings()).draw(at / 25.0))
    writer.release()
    content = path.read_bytes()
    last = content.rindex(b"00dc", 0, content.rindex(b"idx1"))
    with socket.create_server(("127.0.0.1", 0)) as server, ExitStack() as connections:

        def serve():
            connection = connections.enter_context(server.accept()[0])
            connection.recv(4096)
            time.sleep(pause)
            connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: video/x-msvideo\r\n\r\n" + content[:last])

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{server.getsockname()[1]}/field.avi"


def test_a_frame_of_a_stream_does_not_wait_for_the_next_one(tmp_path):
    """FFmpeg's threads would hold back as many frames as there are further cores, whose times would then be wrong."""
    with stream(tmp_path / "field.avi") as address:
        camera = OpenCvCamera(CameraSettings(source=address, lost_ms=10_000))
        begun = time.monotonic()
        assert all(camera.read().image.shape == (SIZE[1], SIZE[0], 3) for _ in range(5))
        assert time.monotonic() - begun < 5.0  # FFmpeg gives what it holds back after `lost_ms`
        camera.close()


def test_a_frame_may_have_waited_while_its_stream_was_opened(tmp_path):
    with stream(tmp_path / "field.avi", pause=0.5) as address:
        begun = time.monotonic()
        camera = OpenCvCamera(CameraSettings(source=address))
        assert camera.read().captured < begun + 0.25
        camera.close()


def test_attack_2_a_stream_of_large_frames_is_not_decoded(tmp_path):
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    writer.write(SyntheticCamera(CameraSettings()).draw(0.0))
    writer.release()
    with pytest.raises(CameraError, match=r"field\.avi has 640 x 512 px.*at most 0\.1 Mpx"):
        OpenCvCamera(CameraSettings(source=f"file://{path}", max_megapixels=0.1))


def test_attack_2_a_frame_larger_than_the_stream_said_is_rejected(monkeypatch):
    monkeypatch.setattr(camera_opencv.cv2, "VideoCapture", Capture)
    camera = OpenCvCamera(CameraSettings(source="rtsp://a/b", max_megapixels=0.1))
    small, large = (np.zeros((side, side, 3), np.uint8) for side in (300, 400))
    Capture.made.frames = iter([small, large, small])
    camera.read()
    with pytest.raises(BrokenFrameError, match="frame has 400 x 400 px"):
        camera.read()
    camera.read()


def test_names_of_devices():
    assert str(device_path("2")) == "/dev/video2"
    assert str(device_path("/dev/v4l/by-id/usb-x")) == "/dev/v4l/by-id/usb-x"
    assert device_path("http://a/0") is None
    assert device_path("²") is None
    assert device_path("9" * 5000) is None


def test_what_no_camera_of_opencv_can_be_asked_is_refused():
    with pytest.raises(InputError, match="four letters"):
        check_opencv_settings(CameraSettings(source="0", pixel_format="MJPEG"))
    if not cv2.videoio_registry.hasBackend(cv2.CAP_GSTREAMER):
        with pytest.raises(InputError, match="without GStreamer"):
            check_opencv_settings(CameraSettings(source="gstreamer:videotestsrc ! appsink"))


def test_a_picture_of_no_bytes_is_broken(device, monkeypatch):
    monkeypatch.setattr(Capture, "get", lambda self, name: 0)
    camera = OpenCvCamera(CameraSettings(source="0"))
    Capture.made.frames = iter([np.zeros((0, 0, 3), np.uint8), np.zeros((2, 2), np.uint16)])
    for _ in range(2):
        with pytest.raises(BrokenFrameError, match="not an 8-bit image"):
            camera.read()
