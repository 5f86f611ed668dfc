"""Motion JPEG from a real HTTP server that dies and comes back."""

import json
import signal
import socket
import threading
import time
import tracemalloc
from contextlib import closing, contextmanager, suppress

import cv2
import numpy as np
import pytest

from tests.vm_embedded.cameras.mjpeg_server import LiveServer, Server, time_of
from tests.vm_embedded.live.running import DEMO, LENS, running
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings
from vm_embedded.cameras.grabber import MOST_HANGING
from vm_embedded.cameras.http_get import parse_url
from vm_embedded.cameras.mjpeg import MjpegCamera, NotMotionJpegError
from vm_embedded.cameras.open_camera import camera_opener
from vm_embedded.cameras.synthetic import SIZE
from vm_embedded.errors import InputError
from vm_embedded.output.recorder import MESSAGES


@contextmanager
def camera_of(server, **settings):
    """A camera that reads from a server; both end with the block."""
    try:
        with closing(MjpegCamera(CameraSettings(source=server.address, **settings))) as camera:
            yield camera
    finally:
        server.kill()


@pytest.mark.parametrize("length", [True, False], ids=["with lengths", "without"])
def test_motion_jpeg_is_read_picture_by_picture(pictures, length):
    with camera_of(Server(pictures, length=length, rate=100.0)) as camera:
        for at in range(20):
            shot = camera.read()
            assert shot.encoded == pictures[at]
            assert shot.image.shape == (SIZE[1], SIZE[0], 3)


def test_a_picture_that_is_cut_short_is_not_taken_and_the_next_one_is(pictures):
    count = iter(range(1000))
    server = Server(pictures, spoil=lambda part: part[: len(part) // 2] if next(count) % 2 else part, rate=100.0)
    with camera_of(server) as camera:
        for _ in range(5):
            assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
            with pytest.raises(BrokenFrameError, match="cut short"):
                camera.read()


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
    with camera_of(Server(pictures, spoil=lambda _: next(spoiled), rate=100.0)) as camera:
        for says in ("32767 x 32767 px, 1074 Mpx; at most 50 Mpx", "cut short or damaged"):
            with pytest.raises(BrokenFrameError, match=says):
                camera.read()
            assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
    assert capfd.readouterr() == ("", "")


def test_a_server_that_falls_silent_is_given_up_in_time(pictures):
    stop = threading.Event()
    with camera_of(Server(pictures, spoil=lambda part: stop.wait(20.0) or part), lost_ms=200) as camera:
        started = time.monotonic()
        with pytest.raises(CameraError, match="timed out"):
            camera.read()
        assert time.monotonic() - started < 5.0
        stop.set()


def test_what_is_no_motion_jpeg_is_said(pictures):
    server = Server(pictures)
    try:
        with pytest.raises(NotMotionJpegError, match="text/html"):
            MjpegCamera(CameraSettings(source=server.address.replace("stream", "page")))
    finally:
        server.kill()
    with pytest.raises(CameraError, match="refused"):
        MjpegCamera(CameraSettings(source=server.address))


@pytest.mark.long
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
    for wrong in ("http://a..b/", f"http://{'a' * 64}/"):
        with pytest.raises(InputError, match="is not a valid address"):
            parse_url(wrong)


def test_characters_that_http_does_not_allow_are_escaped(pictures):
    server = Script(HEAD + b"--frame\r\nContent-Length: %d\r\n\r\n" % len(pictures[0]) + pictures[0] + b"\r\n")
    try:
        camera = MjpegCamera(CameraSettings(source=f"{server.address}my cam/ä%20?size=1 2&a=ü/?"))
        assert camera.read().encoded == pictures[0]
        camera.close()
    finally:
        server.kill()
    assert server.requests[0].startswith(b"GET /my%20cam/%C3%A4%20?size=1%202&a=%C3%BC/? HTTP/1.1\r\n")


@pytest.mark.long
def test_passwords_of_cameras_are_not_shown(tmp_path):
    pose = ("--lens", DEMO / "lens0000000.yaml", "--height", 0.6)
    with running(tmp_path, "--camera", "http://user:secret@127.0.0.1:9/x", *pose) as found:
        found.wait_for_state("camera_lost")
        found.stop()
    assert "secret" not in json.dumps([found.messages, found.events])
    assert "no response from http://127.0.0.1:9/x" in json.dumps(found.messages)


@pytest.fixture
def traced_memory():
    """The most memory that was in use since the test began [bytes]."""
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()


@pytest.mark.parametrize("length", [b"f" * 16, b"7" + b"f" * 15, b"-1", b"-5", b"x", b"9" * 5000])
def test_attack_8_a_chunk_of_any_length_is_a_camera_error(length, traced_memory):
    """The server sends its stream in chunks; the length of the second one is hostile, and its content is large."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        connection, _ = listening.accept()
        with connection, suppress(OSError):
            connection.recv(4096)
            head = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n"
            connection.sendall(
                head + b"Transfer-Encoding: chunked\r\n\r\n9\r\n--frame\r\n\r\n" + length + b"\r\nab\r\n"
            )
            for _ in range(64):
                connection.sendall(bytes(2**20))

    threading.Thread(target=serve, daemon=True).start()
    settings = CameraSettings(source=f"http://127.0.0.1:{listening.getsockname()[1]}/", lost_ms=500)
    with listening:
        camera = MjpegCamera(settings)
        with pytest.raises(CameraError, match=r"http://127\.0\.0\.1"):
            camera.read()
        camera.close()
    assert traced_memory() < 96 * 2**20  # an image may have 64 MiB


STAMPS = pytest.mark.parametrize("stamps", [None, 5000.0], ids=["without stamps", "X-Timestamp"])


@pytest.mark.long
@STAMPS
def test_attack_5_after_a_stall_of_the_network_a_frame_is_as_old_as_it_is(pictures, stamps):
    server = LiveServer(pictures, stamps)
    shots, old = [], 0
    with camera_of(server, lost_ms=10000) as camera:
        for at in range(150):
            if at in (40, 100):
                server.stalled.set()
                threading.Timer(1.0, server.stalled.clear).start()
            try:
                shots.append(camera.read())
            except BrokenFrameError:  # it is too old
                old += 1
        said = np.array([each.captured - time_of(each.encoded) for each in shots])
        assert said.max() < 0.25  # a frame that waited is up to 1 s old
        assert old > 5
        assert len(shots) > 50


@pytest.mark.long
@STAMPS
@pytest.mark.parametrize("what", ["the network", "the detector"])
def test_attack_5_after_a_stall_no_old_frame_is_reported(tmp_path, pictures, stamps, what):
    (tmp_path / "vm.toml").write_text(LENS)
    server = LiveServer(pictures, stamps)
    kept = tmp_path / "recordings"
    options = ("--config", tmp_path / "vm.toml", "--camera", server.address, "--camera-lost-ms", "10000")
    try:
        with running(tmp_path, *options, "--recorder-folder", kept, "--recorder-seconds", "60") as found:
            found.wait_for_state("ok")
            for _ in range(3):
                if what == "the network":
                    server.stalled.set()
                    time.sleep(1.0)
                    server.stalled.clear()
                else:
                    found.process.send_signal(signal.SIGSTOP)
                    time.sleep(1.0)
                    found.process.send_signal(signal.SIGCONT)
                before = len(found.frames)
                found.wait(lambda before=before: len(found.frames) > before + 20)
            found.process.send_signal(signal.SIGUSR1)
            found.wait(lambda: any(each["event"] == "recorded" for each in found.events))
            assert found.stop()[0] == 0
    finally:
        server.kill()
    (folder,) = kept.iterdir()
    messages = [json.loads(line) for line in (folder / MESSAGES).read_text().splitlines()]
    pictures = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    assert len(messages) == len(pictures) > 60
    # A message was sent age_ms after the time of its frame, as the detector says. This is when it was really taken:
    ages = [each["t"] + 1e-3 * each["age_ms"] - time_of(one) for each, one in zip(messages, pictures, strict=True)]
    assert max(ages) < 0.5, sorted(ages)[-5:]


class Script:
    """A server that answers each connection with the next reply: bytes, or a function that gets the connection."""

    def __init__(self, *replies):
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}/"
        self.requests = []
        self._replies = replies
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        try:
            while True:
                connection, _ = self._listening.accept()
                self.requests.append(connection.recv(65536))
                number = len(self.requests) - 1
                threading.Thread(target=self._reply, args=(connection, number), daemon=True).start()
        except OSError:
            return

    def _reply(self, connection, number):
        reply = self._replies[min(number, len(self._replies) - 1)]
        with connection, suppress(OSError):
            if callable(reply):
                reply(connection)
            else:
                connection.sendall(reply)

    def kill(self):
        self._listening.close()


HEAD = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n"


@pytest.mark.parametrize("after", ["nothing", "in a line", "in a picture"])
def test_attack_12_a_trickle_ends_a_read_in_time(pictures, after):
    """A byte now and then, at once or after the beginning of a part."""
    begin = {
        "nothing": b"",
        "in a line": HEAD + b"--fr",
        "in a picture": HEAD + b"--frame\r\nContent-Length: 999\r\n\r\n",
    }
    stop = threading.Event()

    def trickle(connection):
        connection.sendall(begin[after])
        while not stop.wait(0.02):
            connection.sendall(b"x")

    server = Script(trickle)
    try:
        with pytest.raises(CameraError, match="timed out"):
            MjpegCamera(CameraSettings(source=server.address, open_ms=300, lost_ms=300)).read()
    finally:
        stop.set()
        server.kill()


@pytest.mark.long
def test_attack_12_a_stream_of_one_frame_and_a_trickle_is_opened_again_and_again(tmp_path, pictures):
    (tmp_path / "vm.toml").write_text(LENS)
    stop = threading.Event()

    def one_frame(connection):
        content = pictures[len(server.requests) % len(pictures)]
        connection.sendall(HEAD + b"--frame\r\nContent-Length: %d\r\n\r\n" % len(content) + content)
        while not stop.wait(0.05):
            connection.sendall(b"x")

    server = Script(one_frame)
    options = ("--config", tmp_path / "vm.toml", "--camera", server.address, "--camera-open-ms", "500")
    try:
        with running(tmp_path, *options, "--camera-lost-ms", 300, "--camera-longest-retry-ms", 20) as found:
            found.wait(lambda: len(server.requests) > MOST_HANGING + 4)
            assert found.frames
            assert found.stop()[0] == 0
    finally:
        stop.set()
        server.kill()


@pytest.mark.long
def test_attack_12_a_camera_can_not_lead_to_another_address(tmp_path):
    """By a redirect, by a playlist (HLS), or by a session description (SDP)."""
    (tmp_path / "vm.toml").write_text(LENS)
    other = Script(b"HTTP/1.0 404 Not Found\r\n\r\n")
    away = other.address.encode()
    playlist = b"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n" + away + b"a.ts\n"
    kind = b"HTTP/1.0 200 OK\r\nContent-Type: application/vnd.apple.mpegurl\r\n\r\n"
    first, moved = b"HTTP/1.0 200 OK\r\nContent-Type: video/mp2t\r\n\r\n", b"HTTP/1.0 302 Found\r\nLocation: " + away
    for replies in ((kind + playlist,), (first, moved + b"\r\n\r\n"), (moved + b"\r\n\r\n",)):
        server = Script(*replies)
        options = ("--config", tmp_path / "vm.toml", "--camera", server.address + "x.m3u8", "--camera-open-ms", 2000)
        with running(tmp_path, *options, "--camera-retry-ms", 50) as found:
            found.wait(lambda server=server: len(server.requests) > 4)
            found.wait_for_state("camera_lost")
            found.stop()
        server.kill()
    assert other.requests == []
    other.kill()


def test_a_stream_in_another_format_is_still_read(tmp_path, pictures):
    path = tmp_path / "film.avi"
    film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, SIZE)
    for each in pictures[:20]:
        film.write(cv2.imdecode(np.frombuffer(each, np.uint8), cv2.IMREAD_COLOR))
    film.release()
    content = path.read_bytes()
    server = Script(b"HTTP/1.0 200 OK\r\nContent-Type: video/x-msvideo\r\n\r\n" + content)
    try:
        camera = camera_opener(CameraSettings(source=server.address))()
        assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
        camera.close()
    finally:
        server.kill()
