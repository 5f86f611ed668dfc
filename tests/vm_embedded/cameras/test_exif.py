"""Images that their EXIF entry turns: one rule for all formats and programs."""

import http.server
import io
import struct
import threading
import zlib
from contextlib import closing
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tests.vm_embedded.cli.commands import lines, run
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.decoding import decode
from vm_embedded.cameras.exif import orientation_of, turned
from vm_embedded.cameras.image_files import open_source, read_image
from vm_embedded.cameras.open_camera import camera_opener
from vm_embedded.cameras.ros.images import image_of

STORED = np.kron(np.random.default_rng(0).integers(0, 255, (3, 4, 3), dtype=np.uint8), np.ones((16, 16, 1), np.uint8))
LOSSLESS = {".jpg": {"quality": 100, "subsampling": 0}, ".png": {}, ".webp": {"lossless": True}, ".tif": {}}


def written(suffix, orientation, image=STORED):
    """The bytes of an image file with an EXIF orientation."""
    exif, file = Image.Exif(), io.BytesIO()
    exif[0x0112] = orientation
    colors = image[..., ::-1] if image.ndim == 3 else image
    formats = {".jpg": "JPEG", ".png": "PNG", ".webp": "WEBP", ".tif": "TIFF"}
    Image.fromarray(colors).save(file, formats[suffix], exif=exif, **LOSSLESS[suffix])
    return file.getvalue()


def upright(orientation, image=STORED):
    """An image as OpenCV turns that of a JPEG."""
    steps = {
        2: [1], 3: [-1], 4: [0], 5: ["T"], 6: ["T", 1], 7: ["T", -1], 8: ["T", 0],
    }.get(orientation, [])  # fmt: skip
    for step in steps:
        image = np.swapaxes(image, 0, 1) if step == "T" else cv2.flip(image, step)
    return image


def near(one, other):
    return one.shape == other.shape and np.abs(one.astype(float) - other).mean() < 3.0


@pytest.mark.parametrize("raw", [False, True])
@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", LOSSLESS)
def test_an_image_of_any_format_is_turned_once(suffix, orientation, raw):
    assert near(decode(written(suffix, orientation), raw), upright(orientation))


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_a_gray_image_is_turned_too(suffix):
    gray = np.ascontiguousarray(STORED[..., 0])
    assert near(decode(written(suffix, 6, gray), raw=True), upright(6, gray))


def test_the_rule_is_that_of_opencv():
    for orientation in range(1, 9):
        content = written(".jpg", orientation)
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(decode(content), image)


@pytest.mark.parametrize("value", [0, 9, 65535])
def test_an_orientation_that_does_not_exist_turns_nothing(value):
    entry = struct.pack(">2sHIHHHIHHI", b"MM", 42, 8, 1, 0x0112, 3, 1, value, 0, 0)
    content = written(".png", 6)
    plain = content[:33] + chunk(b"eXIf", entry) + cv2.imencode(".png", STORED)[1].tobytes()[33:]
    np.testing.assert_array_equal(decode(plain), STORED)


def chunk(kind, content):
    return struct.pack(">I4s", len(content), kind) + content + struct.pack(">I", zlib.crc32(kind + content))


def test_the_entry_behind_the_data_of_a_png_and_behind_other_segments_of_a_jpeg_counts():
    entry = struct.pack("<2sHIHHHIHHI", b"II", 42, 8, 1, 0x0112, 3, 1, 8, 0, 0)
    png = cv2.imencode(".png", STORED)[1].tobytes()
    assert orientation_of(png[:-12] + chunk(b"eXIf", entry) + png[-12:]) == 8
    jpeg = cv2.imencode(".jpg", STORED)[1].tobytes()
    other = b"http://ns.adobe.com/xap/1.0/\0<x/>"
    segments = b"".join(b"\xff\xe1" + struct.pack(">H", 2 + len(each)) + each for each in (other, b"Exif\0\0" + entry))
    assert orientation_of(jpeg[:2] + segments + jpeg[2:]) == 8


@given(st.sampled_from(list(LOSSLESS)), st.integers(1, 8), st.data())
def test_a_damaged_entry_is_no_error(suffix, orientation, data):
    content = bytearray(written(suffix, orientation))
    for _ in range(data.draw(st.integers(0, 4))):
        content[data.draw(st.integers(0, min(len(content), 200) - 1))] = data.draw(st.integers(0, 255))
    assert orientation_of(bytes(content[: data.draw(st.integers(0, len(content)))])) in range(1, 9)


@given(st.integers(1, 8), st.sampled_from([(3, 5), (3, 5, 3), (3, 5, 4)]))
def test_a_turn_keeps_all_pixels_and_swaps_the_sides_from_5_on(orientation, shape):
    image = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    found = turned(image, orientation)
    assert found.shape[:2] == (shape[:2] if orientation < 5 else shape[1::-1])
    np.testing.assert_array_equal(np.sort(found, axis=None), np.sort(image, axis=None))
    np.testing.assert_array_equal(found, upright(orientation, image))


def test_photos_are_turned_as_films_are(tmp_path):
    """A film's own entry for its turn is a matrix; OpenCV turns the frames as it says."""
    (tmp_path / "photo.jpg").write_bytes(written(".jpg", 6))
    frame = next(open_source(str(tmp_path / "photo.jpg")).frames)
    assert near(frame.read(), upright(6))
    path = tmp_path / "film.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, STORED.shape[1::-1])
    writer.write(STORED)
    writer.release()
    content = path.read_bytes()
    at = content.index(b"tkhd") + 4 + 40  # the matrix of the track
    assert content[at : at + 36] == struct.pack(">9I", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    quarter = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, 0, 0, 1 << 30)
    path.write_bytes(content[:at] + quarter + content[at + 36 :])
    frame = next(open_source(str(path)).frames).read()
    assert frame.shape == upright(6).shape
    assert np.abs(frame.astype(float) - upright(6)).mean() < 25.0


@pytest.mark.long
def test_a_phone_s_photo_shows_the_balls_that_the_upright_one_shows(shared, tmp_path):
    case = shared / "cases" / "exif-turned"
    if not case.is_dir():
        pytest.skip("needs ../shared/cases")
    pose = ("--lens", case / "lens.toml", "--height", 0.77, "--pitch", "4.5deg", "--object-radius", 0.11)
    found = [lines(run("--camera", case / each, *pose))[0]["detections"] for each in ("upright.jpg", "phone.jpg")]
    assert len(found[0]) == len(found[1]) == 2
    for one, other in zip(*found, strict=True):
        assert one["position"] == pytest.approx(other["position"], rel=0.05)
    for suffix in (".png", ".tif"):
        image = turned_back(read_image(case / "upright.jpg"))
        (tmp_path / f"phone{suffix}").write_bytes(written(suffix, 6, image))
        assert len(lines(run("--camera", tmp_path / f"phone{suffix}", *pose))[0]["detections"]) == 2


def turned_back(image):
    """An image as a camera stores it that writes the orientation 6."""
    return np.ascontiguousarray(np.rot90(image))


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_cameras_of_the_network_and_topics_are_turned_as_files_are(suffix, tmp_path):
    content = written(suffix, 6)

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            part = b"--frame\r\nContent-Length: %d\r\n\r\n%s\r\n" % (len(content), content)
            stream = self.path == "/stream"
            kind = (
                "multipart/x-mixed-replace; boundary=frame" if stream else f"image/{suffix[1:].replace('jpg', 'jpeg')}"
            )
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(part * 2 if stream else content)

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for place in ("stream", f"snapshot{suffix}"):
            source = f"http://127.0.0.1:{server.server_port}/{place}"
            with closing(camera_opener(CameraSettings(source=source))()) as camera:
                assert near(camera.read().image, upright(6))
        server.shutdown()
    assert near(image_of(SimpleNamespace(format=suffix[1:], data=content)), upright(6))
