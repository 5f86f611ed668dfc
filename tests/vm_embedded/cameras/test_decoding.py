"""Images from bytes: whole, cut short, enormous, and of 16 bits."""

import os
import re
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_embedded.cli.commands import one_complaint, run
from tests.vm_embedded.live.running import DEMO
from vm_embedded.cameras.camera import BrokenFrameError
from vm_embedded.cameras.decoding import decode, decode_frame
from vm_embedded.cameras.image_header import check_pixels, image_size
from vm_embedded.cameras.library_messages import library_messages
from vm_embedded.cameras.synthetic import SIZE
from vm_embedded.errors import InputError

IMAGE = min(DEMO.glob("image*.jpg"))
POSE = ("--lens", IMAGE.with_name(IMAGE.name.replace("image", "lens").replace(".jpg", ".yaml")))
LARGE = (65500, 16000)
"""Width and height that need 3 GB as BGR [px]."""


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_half_a_jpeg_is_no_picture(pictures, share):
    with pytest.raises(BrokenFrameError):
        decode_frame(pictures[0][: int(share * len(pictures[0]))])
    assert decode_frame(pictures[0] + bytes(100)).shape == (SIZE[1], SIZE[0], 3)


PROGRESSIVE, RESTARTS = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 7]


@pytest.mark.parametrize("options", [[], PROGRESSIVE, RESTARTS], ids=["plain", "progressive", "restarts"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.999])
def test_attack_4_half_a_jpeg_with_an_end_marker_is_no_picture(options, share, capfd):
    image = cv2.imread(str(IMAGE))
    whole = cv2.imencode(".jpg", image, options)[1].tobytes()
    head = whole.index(b"\xff\xda")
    content = whole[: head + int(share * (len(whole) - head))].removesuffix(b"\xff") + b"\xff\xd9"
    with pytest.raises(BrokenFrameError, match=r"is cut short or damaged \(Corrupt JPEG data"):
        decode_frame(content)
    assert decode(whole).shape == image.shape
    assert capfd.readouterr() == ("", "")


def test_attack_4_every_picture_of_the_demo_is_whole_and_none_of_its_halves(capfd):
    for path in DEMO.glob("image*.jpg"):
        content = path.read_bytes()
        decode(content)
        with pytest.raises(InputError, match="cut short"):
            decode(content[: len(content) // 2] + b"\xff\xd9")
    assert capfd.readouterr() == ("", "")


def test_attack_4_vm_detect_reports_it_in_a_line(tmp_path):
    content = IMAGE.read_bytes()
    path = tmp_path / IMAGE.name
    path.write_bytes(content[: len(content) // 2] + b"\xff\xd9")
    one_complaint(run("--camera", path, *POSE, code=1), str(path), "is cut short or damaged")


def test_bytes_between_a_picture_and_its_end_marker_do_no_harm():
    content = IMAGE.read_bytes()
    assert content.endswith(b"\xff\xd9")
    np.testing.assert_array_equal(decode(content[:-2] + b"12345678" + content[-2:]), decode(content))


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".ppm", ".tif", ".webp"])
def test_half_of_a_file_of_another_kind_is_no_picture(suffix):
    whole = cv2.imencode(suffix, cv2.imread(str(IMAGE)))[1].tobytes()
    for share in (0.0, 0.001, 0.1, 0.5, 0.99):
        with pytest.raises(InputError):
            decode(whole[: int(share * len(whole))])


def test_lines_of_others_still_reach_standard_error(capfd):
    with library_messages() as messages:
        os.write(2, b"Corrupt JPEG data: 3 extraneous bytes\na line of another thread\n")
        assert messages == []
    assert messages == ["Corrupt JPEG data: 3 extraneous bytes"]
    assert capfd.readouterr() == ("", "a line of another thread\n")


def chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def bomb(suffix):
    """A small file of a kind that declares LARGE."""
    content = bytearray(cv2.imencode(suffix, np.full((32, 32, 3), 90, np.uint8))[1].tobytes())
    if suffix == ".jpg":
        at = content.index(b"\xff\xc0") + 5
        content[at : at + 4] = struct.pack(">HH", LARGE[1], LARGE[0])
    elif suffix == ".png":
        head = struct.pack(">IIBBBBB", *LARGE, 8, 2, 0, 0, 0)
        content = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + bytes(content[33:])
    elif suffix == ".bmp":
        content[18:26] = struct.pack("<ii", LARGE[0], -LARGE[1])
    elif suffix == ".ppm":
        content = b"P6 # a comment\n%d\n%d\n255\n" % LARGE + bytes(30)
    elif suffix == ".tif":
        entries = [(256, 4, 1, LARGE[0]), (257, 4, 1, LARGE[1]), (258, 3, 1, 8), (273, 4, 1, 8), (277, 3, 1, 1)]
        content = b"II*\0" + struct.pack("<IH", 8, 5) + b"".join(struct.pack("<HHII", *each) for each in entries)
    else:
        content[12:16] = b"VP8X"
        content[24:30] = b"".join((each - 1).to_bytes(3, "little") for each in LARGE)
    return bytes(content)


KINDS = (".jpg", ".png", ".bmp", ".ppm", ".tif", ".webp")


@pytest.mark.parametrize("suffix", KINDS)
def test_attack_2_an_image_that_declares_a_huge_size_is_refused_before_it_is_decoded(suffix):
    content = bomb(suffix)
    assert len(content) < 4000
    assert image_size(content) == LARGE
    with pytest.raises(BrokenFrameError, match=r"65500 x 16000 px, 1048 Mpx; at most 50 Mpx"):
        decode_frame(content)
    with pytest.raises(InputError, match="at most 100 Mpx"):
        decode(content, max_megapixels=100.0)


def test_a_size_just_above_the_limit_does_not_read_like_the_limit():
    with pytest.raises(InputError, match=r"0\.3072 Mpx; at most 0\.3 Mpx"):
        check_pixels(640, 480, 0.3)
    with pytest.raises(InputError, match=r"50\.2 Mpx; at most 50 Mpx"):
        check_pixels(8000, 6275, 50.0)


def test_a_png_whose_chunk_declares_gigabytes_is_refused_before_it_is_decoded():
    whole = cv2.imencode(".png", np.full((6, 8, 3), 90, np.uint8))[1].tobytes()
    at = whole.index(b"IDAT")
    with pytest.raises(InputError, match=r"^is cut short$"):
        decode(whole[: at - 4] + b"\xff\xff\xff\xf0" + whole[at:])
    frame = chunk(b"fcTL", struct.pack(">IIIIIHHBB", 0, *LARGE, 0, 0, 1, 1, 0, 0))
    with pytest.raises(InputError, match="1048 Mpx"):
        decode(whole[: at - 4] + frame + whole[at - 4 :])


def test_a_png_with_wrong_data_is_no_picture_and_prints_nothing(capfd):
    head = struct.pack(">IIBBBBB", 8, 6, 8, 2, 0, 0, 0)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(bytes(150))[:-4] + b"1234") + chunk(b"IEND", b"")
    with pytest.raises(InputError, match=r"is cut short or damaged \(libpng error: "):
        decode(b"\x89PNG\r\n\x1a\n" + parts)
    assert capfd.readouterr() == ("", "")


def test_attack_2_vm_detect_refuses_it_and_its_limit_is_an_option(tmp_path):
    path = tmp_path / "image.jpg"
    path.write_bytes(bomb(".jpg"))
    one_complaint(run("--camera", path, *POSE, code=1), str(path), "1048 Mpx; at most 50 Mpx")
    done = run("--camera", IMAGE, "--camera-max-megapixels", "0.1", code=1)
    one_complaint(done, "640 x 512 px", "at most 0.1 Mpx")


@given(st.sampled_from(KINDS), st.integers(1, 90), st.integers(1, 90))
def test_the_size_is_the_one_of_the_decoded_image(suffix, width, height):
    content = cv2.imencode(suffix, np.full((height, width, 3), 90, np.uint8))[1].tobytes()
    assert image_size(content) == (width, height)
    assert decode(content).shape == (height, width, 3)


@given(st.binary(max_size=60), st.sampled_from([bomb(kind)[:12] for kind in KINDS]))
def test_any_header_has_a_size_or_is_refused(content, start):
    try:
        width, height = image_size(start + content)
    except InputError:
        return
    assert width >= 0
    assert height >= 0


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
@pytest.mark.parametrize("raw", [False, True])
def test_attack_9_sixteen_bits_become_eight(suffix, raw):
    values = np.random.default_rng(0).integers(0, 65536, (20, 30)).astype(np.uint16)
    found = decode(cv2.imencode(suffix, values)[1].tobytes(), raw)
    assert found.dtype == np.uint8
    assert found.shape == ((20, 30) if raw else (20, 30, 3))
    np.testing.assert_allclose(found if raw else found[:, :, 0], values >> 8, atol=1)


def test_attack_9_numbers_of_other_kinds_are_refused():
    values = np.full((8, 8), 0.5, dtype=np.float32)
    with pytest.raises(InputError, match=re.escape("has float32 values; only images of 8 and 16 bits")):
        decode(cv2.imencode(".tif", values)[1].tobytes(), raw=True)
    with pytest.raises(InputError, match="values from 0 to 1023; scale them to 255 or 65535"):
        decode(b"P5\n4 4\n1023\n" + bytes(32))
