"""Users, passwords and single images over HTTP, from real servers."""

import base64
import hashlib
import http.server
import json
import re
import threading
import time
from contextlib import closing, contextmanager
from urllib.parse import quote

import pytest

from tests.preloaded import run_preloaded
from tests.programs import BIN
from tests.vm_embedded.live.running import LENS, running
from vm_embedded.cameras.camera import BrokenFrameError, CameraError, CameraSettings
from vm_embedded.cameras.http_get import HttpGet
from vm_embedded.cameras.open_camera import SnapshotCamera, camera_opener
from vm_embedded.cameras.synthetic import SIZE
from vm_embedded.cli.finding import BAD, GOOD, WARNING

USER, PASSWORD, NONCE = "op", 'p/a:s"s#1', "dcd98b7102dd2f0e"


class Camera:
    """A server with a password: what it asks for, the requests that it got, and the images that it sends."""

    def __init__(self, challenges, accepts, pictures=(b"content",), stream=False):
        camera = self
        self.requests, self.pictures, self.sent = [], list(pictures), 0

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                given = self.headers.get("Authorization")
                camera.requests.append(given)
                if not accepts(self.path, given):
                    self.send_response(401)
                    for each in challenges:
                        self.send_header("WWW-Authenticate", each)
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                self.send_response(200)
                kind = "multipart/x-mixed-replace; boundary=b" if stream else "image/jpeg"
                self.send_header("Content-Type", kind)
                self.end_headers()
                for _ in range(1000 if stream else 1):
                    picture = camera.pictures[camera.sent % len(camera.pictures)]
                    camera.sent += 1
                    head = b"--b\r\nContent-Length: %d\r\n\r\n" % len(picture) if stream else b""
                    try:
                        self.wfile.write(head + picture)
                    except OSError:
                        return

            def log_message(self, *_):
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.host = f"127.0.0.1:{self._server.server_address[1]}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def address(self, user=USER, password=PASSWORD, path="/video?channel=1"):
        return f"http://{quote(user, safe='')}:{quote(password, safe='')}@{self.host}{path}"

    def close(self):
        self._server.shutdown()
        self._server.server_close()


@contextmanager
def serving(*arguments, **more):
    camera = Camera(*arguments, **more)
    try:
        yield camera
    finally:
        camera.close()


def is_right(path, given, hashed=hashlib.md5, qop=True, session=False):
    """Whether a digest is right, computed as in RFC 7616."""
    if given is None or not given.startswith("Digest "):
        return False
    fields = {name: value.replace('\\"', '"') for name, value in re.findall(r'(\w+)="?((?:\\"|[^",])*)', given[7:])}

    def digest(text):
        return hashed(text.encode()).hexdigest()

    identity = digest(f"{USER}:cam:{PASSWORD}")
    if session:
        identity = digest(f"{identity}:{NONCE}:{fields['cnonce']}")
    middle = f"{NONCE}:{fields['nc']}:{fields['cnonce']}:auth" if qop else NONCE
    expected = digest(f"{identity}:{middle}:{digest(f'GET:{path}')}")
    return fields["username"] == USER and fields["uri"] == path and fields["response"] == expected


REALM = f'realm="cam", nonce="{NONCE}"'


@pytest.mark.parametrize(
    ("challenges", "how"),
    [
        ([f"Digest {REALM}"], {"qop": False}),
        ([f'Digest {REALM}, qop="auth,auth-int", opaque="a,b", algorithm=MD5'], {}),
        ([f'Digest {REALM}, qop="auth", algorithm=MD5-sess'], {"session": True}),
        ([f'Digest {REALM}, qop="auth", algorithm=SHA-256', f'Digest {REALM}, qop="auth"'], {"hashed": hashlib.sha256}),
        ([f'Basic realm="x", Digest {REALM}, qop=auth'], {}),
    ],
)
def test_a_camera_that_asks_for_a_digest_gets_one_and_never_the_password(challenges, how):
    with serving(challenges, lambda path, given: is_right(path, given, **how)) as camera:
        with closing(HttpGet(camera.address(), 10.0)) as get:
            assert get.response.read(100) == b"content"
        assert camera.requests[0] is None
        assert not any((each or "").startswith("Basic") for each in camera.requests)
        with pytest.raises(CameraError, match=r"401.*check user and password"):
            HttpGet(camera.address(password="wrong"), 10.0)


@pytest.mark.parametrize("challenges", [['Basic realm="x"'], []], ids=["basic", "nothing"])
def test_a_camera_that_asks_for_a_password_gets_it(challenges):
    wanted = "Basic " + base64.b64encode(f"{USER}:{PASSWORD}".encode()).decode()
    with serving(challenges, lambda _, given: given == wanted) as camera:
        HttpGet(camera.address(), 10.0).close()
        with pytest.raises(CameraError, match="USER:PASSWORD@"):
            HttpGet(f"http://{camera.host}/", 10.0)


def test_a_camera_that_asks_for_something_else_does_not_get_the_password():
    with serving(["NTLM", 'Digest nonce="a", qop="auth-int"'], lambda *_: False) as camera:
        with pytest.raises(CameraError, match="neither basic nor digest"):
            HttpGet(camera.address(), 10.0)
        assert camera.requests == [None]


def test_a_detector_and_the_doctor_read_a_stream_behind_a_digest(tmp_path, pictures):
    """The pictures have bytes that a decoder skips: behind the end, and more than a kilobyte."""
    challenges = [f'Digest {REALM}, qop="auth"']
    padded = [each + bytes(range(256)) * 10 for each in pictures]
    (tmp_path / "vm.toml").write_text(LENS)
    with serving(challenges, is_right, padded, stream=True) as camera:
        options = ("--config", tmp_path / "vm.toml", "--camera", camera.address())
        finding = camera_finding(*options)
        assert (finding["state"], f"{SIZE[0]} x {SIZE[1]} px" in finding["seen"]) == (GOOD, True), finding
        with running(tmp_path, *options) as found:
            found.wait_for_state("ok")
            found.wait(lambda: len(found.frames) > 3)
            found.stop()
    text = json.dumps([found.messages, found.events, finding])
    assert not any(each in text for each in (PASSWORD, quote(PASSWORD, safe=""), "s%22s", USER + ":"))


def camera_finding(*options):
    """The last finding of vm-doctor about the camera."""
    done = run_preloaded([BIN / "vm-doctor", "--json", *map(str, options)])
    findings = [json.loads(line) for line in done.stdout.splitlines()]
    return [each for each in findings if each["about"] == "camera"][-1]


@pytest.mark.long
def test_the_doctor_says_what_is_wrong_with_the_frames(tmp_path, pictures):
    half = [each[: len(each) // 2] + each[-2:] for each in pictures]
    mixed = [each for pair in zip(half, pictures, strict=True) for each in pair]
    (tmp_path / "vm.toml").write_text(LENS)
    for sent, state in ((half, BAD), (mixed, WARNING), (pictures, GOOD)):
        with serving([], lambda *_: True, sent, stream=True) as camera:
            finding = camera_finding("--config", tmp_path / "vm.toml", "--camera", f"http://{camera.host}/")
            assert finding["state"] == state, finding
            assert ("damaged" in finding["seen"]) == (state != GOOD), finding


def test_single_images_are_asked_for_one_by_one(pictures):
    half = pictures[2][: len(pictures[2]) // 2] + pictures[2][-2:]
    sent = [*pictures[:2], half, pictures[3] + b"tail"]
    with serving([f"Digest {REALM}"], lambda path, given: is_right(path, given, qop=False), sent) as server:
        opener = camera_opener(CameraSettings(source=server.address(path="/snap.jpg"), fps=100))
        with closing(opener()) as camera:
            assert isinstance(camera, SnapshotCamera)
            while not server.sent:
                time.sleep(0.01)
            server.sent = 0
            assert [camera.read().encoded for _ in range(2)] == pictures[:2]
            with pytest.raises(BrokenFrameError, match="damaged"):
                camera.read()
            assert camera.read().image.shape == (SIZE[1], SIZE[0], 3)
    with pytest.raises(CameraError, match="no response"):
        camera.read()


@pytest.mark.parametrize("odd", "/?#")
def test_a_password_that_was_not_escaped_is_hidden_and_explained(tmp_path, odd):
    source = f"http://user:hun{odd}ter2@127.0.0.1:9/plain"
    with running(tmp_path, "--camera", source, "--fov", "90deg", "--height", "0.6") as found:
        found.process.wait(30)
        found.stop()
    text = json.dumps([found.messages, found.events])
    assert "hun" not in text
    assert "ter2" not in text
    assert "%23" in text
