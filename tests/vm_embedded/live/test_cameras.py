"""Real servers and real files as cameras: Motion JPEG over HTTP that dies and comes back, videos, folders."""

import http.server
import socketserver
import threading
import time

import cv2
import numpy as np
import pytest

from tests.vm_embedded.live.running import running
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings, decode_frame, same_image
from vm_embedded.cameras.mjpeg import MjpegCamera, NoMotionJpegError, address_of
from vm_embedded.cameras.open_camera import camera_opener, is_live
from vm_embedded.cameras.synthetic import SIZE, SyntheticCamera
from vm_embedded.errors import InputError

LENS = '[lens]\nprojection = "rectilinear"\nfocal_length = 448\nfov = 1.75\n[orientation]\nheight = 0.8\npitch = 0.4\n'


@pytest.fixture(scope="module")
def pictures():
    """Two seconds of a drawn camera as JPEGs."""
    camera = SyntheticCamera(CameraSettings())
    return [cv2.imencode(".jpg", camera.drawn(at / 30.0))[1].tobytes() for at in range(60)]


class Server:
    """Serves pictures as Motion JPEG until it is killed. spoil: makes of each part what is sent."""

    def __init__(self, pictures, port=0, length=True, spoil=lambda part: part, rate=30.0):
        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                if self.path == "/page":
                    self.send_header("Content-Type", "text/html")
                    self.end_headers()
                    return
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                at = 0
                while server.alive:
                    picture = spoil(pictures[at % len(pictures)])
                    head = b"--frame\r\nContent-Type: image/jpeg\r\n"
                    if length:
                        head += b"Content-Length: %d\r\n" % len(picture)
                    try:
                        self.wfile.write(head + b"\r\n" + picture + b"\r\n")
                    except OSError:
                        return
                    at += 1
                    time.sleep(1.0 / rate)

            def log_message(self, *_):
                pass

        class Listening(socketserver.ThreadingMixIn, http.server.HTTPServer):
            daemon_threads = True
            allow_reuse_address = True

        server = self
        self.alive = True
        self._server = Listening(("127.0.0.1", port), Handler)
        self.port = self._server.server_address[1]
        self.address = f"http://127.0.0.1:{self.port}/stream"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def kill(self):
        self.alive = False
        self._server.shutdown()
        self._server.server_close()


@pytest.mark.parametrize("length", [True, False], ids=["with lengths", "without"])
def test_motion_jpeg_is_read_picture_by_picture(pictures, length):
    server = Server(pictures, length=length, rate=100.0)
    try:
        camera = MjpegCamera(CameraSettings(source=server.address))
        for at in range(20):
            shot = camera.read()
            assert shot.encoded == pictures[at]
            assert shot.image.shape == (SIZE[1], SIZE[0], 3)
        camera.close()
    finally:
        server.kill()


def test_a_picture_that_is_cut_short_is_not_taken_and_the_next_one_is(pictures):
    count = iter(range(1000))
    server = Server(pictures, spoil=lambda part: part[: len(part) // 2] if next(count) % 2 else part, rate=100.0)
    try:
        camera = MjpegCamera(CameraSettings(source=server.address))
        for _ in range(5):
            assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
            with pytest.raises(BrokenFrameError, match="cut short"):
                camera.read()
        camera.close()
    finally:
        server.kill()


def test_a_server_that_falls_silent_is_given_up_in_time(pictures):
    stop = threading.Event()
    server = Server(pictures, spoil=lambda part: stop.wait(20.0) or part)
    try:
        camera = MjpegCamera(CameraSettings(source=server.address, lost_ms=200))
        started = time.monotonic()
        with pytest.raises(CameraError, match="timed out"):
            camera.read()
        assert time.monotonic() - started < 5.0
        camera.close()
    finally:
        stop.set()
        server.kill()


def test_what_is_no_motion_jpeg_is_said(pictures):
    server = Server(pictures)
    try:
        with pytest.raises(NoMotionJpegError, match="text/html"):
            MjpegCamera(CameraSettings(source=server.address.replace("stream", "page")))
    finally:
        server.kill()
    with pytest.raises(CameraError, match="refused"):
        MjpegCamera(CameraSettings(source=server.address))


def test_a_server_that_is_killed_and_started_again_is_found_again(tmp_path, pictures):
    (tmp_path / "vm.toml").write_text(LENS)
    server = Server(pictures)
    options = ("--config", tmp_path / "vm.toml", "--camera", server.address)
    with running(tmp_path, *options, "--camera-lost-ms", 400, "--camera-retry-ms", 50) as found:
        found.wait_for_state("ok")
        for _ in range(2):
            server.kill()
            found.wait_for_state("camera_lost")
            server = Server(pictures, server.port)
            found.wait_for_state("ok")
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 20)
        found.wait(lambda: sum(len(each["detections"]) for each in found.frames[before:]) > 10)
        assert found.stop()[0] == 0
    server.kill()


def test_a_video_is_played_at_its_rate_again_and_again(tmp_path):
    camera = SyntheticCamera(CameraSettings())
    path = tmp_path / "field.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    assert writer.isOpened()
    for at in range(10):
        writer.write(camera.drawn(at / 25.0))
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


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_half_a_jpeg_is_no_picture(pictures, share):
    with pytest.raises(BrokenFrameError):
        decode_frame(pictures[0][: int(share * len(pictures[0]))])
    assert decode_frame(pictures[0] + bytes(100)).shape == (SIZE[1], SIZE[0], 3)


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
    assert address_of("http://user:pass@[::1]:81/a?b").port == 81
