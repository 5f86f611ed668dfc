"""Motion JPEG from a real HTTP server that dies and comes back."""

import json
import socket
import threading
import time

import pytest

from tests.vm_embedded.cameras.mjpeg_server import Server
from tests.vm_embedded.live.running import DEMO, LENS, running
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings
from vm_embedded.cameras.mjpeg import MjpegCamera, NotMotionJpegError, parse_url
from vm_embedded.cameras.synthetic import SIZE


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


def test_attacks_2_and_4_a_huge_or_half_picture_is_not_taken_and_the_next_one_is(pictures, capfd):
    at = pictures[0].index(b"\xff\xc0") + 5
    spoiled = iter(
        (
            pictures[0][:at] + b"\x7f\xff\x7f\xff" + pictures[0][at + 4 :],
            pictures[0],
            pictures[0][: len(pictures[0]) // 2] + b"\xff\xd9",
            *[pictures[0]] * 1000,
        )
    )
    server = Server(pictures, spoil=lambda _: next(spoiled), rate=100.0)
    try:
        camera = MjpegCamera(CameraSettings(source=server.address))
        for says in ("32767 x 32767 px, 1074 Mpx; at most 50 Mpx", "cut short or damaged"):
            with pytest.raises(BrokenFrameError, match=says):
                camera.read()
            assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
        camera.close()
    finally:
        server.kill()
    assert capfd.readouterr() == ("", "")


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
        with pytest.raises(NotMotionJpegError, match="text/html"):
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


def test_a_url_is_split_into_its_parts():
    assert parse_url("http://user:pass@[::1]:81/a?b").port == 81


def test_passwords_of_cameras_are_not_shown(tmp_path):
    pose = ("--lens", DEMO / "lens0000000.yaml", "--height", 0.6)
    with running(tmp_path, "--camera", "http://user:secret@127.0.0.1:9/x", *pose) as found:
        found.wait_for_state("camera_lost")
        found.stop()
    assert "secret" not in json.dumps([found.messages, found.events])
    assert "no response from http://127.0.0.1:9/x" in json.dumps(found.messages)


@pytest.mark.parametrize("length", [b"f" * 16, b"7" + b"f" * 15, b"-5", b"x", b"9" * 5000])
def test_attack_8_a_chunk_of_any_length_is_a_camera_error(length):
    """The server sends its stream in chunks; the length of the second one is hostile."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = listening.accept()
        with connection:
            connection.recv(4096)
            head = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n"
            connection.sendall(
                head + b"Transfer-Encoding: chunked\r\n\r\n9\r\n--frame\r\n\r\n" + length + b"\r\nab\r\n"
            )

    threading.Thread(target=serve, daemon=True).start()
    settings = CameraSettings(source=f"http://127.0.0.1:{listening.getsockname()[1]}/", lost_ms=500)
    with listening:
        camera = MjpegCamera(settings)
        with pytest.raises(CameraError, match=r"http://127\.0\.0\.1"):
            camera.read()
        camera.close()
