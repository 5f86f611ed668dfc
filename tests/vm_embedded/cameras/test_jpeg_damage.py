"""JPEGs with more or fewer bytes than they need: damage is what changes pixels."""

import re

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_embedded.cli.commands import lines, run
from tests.vm_embedded.live.running import DEMO
from vm_embedded.cameras.decoding import decode
from vm_embedded.errors import InputError

IMAGE = cv2.imread(str(min(DEMO.glob("image*.jpg"))))[200:456, 100:420]

RESTARTS = cv2.IMWRITE_JPEG_RST_INTERVAL
KINDS = {
    "plain": [],
    "rows": [RESTARTS, 20],
    "short": [RESTARTS, 7],
    "full color": [RESTARTS, 33, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444],
    "progressive": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1],
}
ENCODED = {name: cv2.imencode(".jpg", IMAGE, options)[1].tobytes() for name, options in KINDS.items()}
JUNK = b"\x12\x34\x56\x78"


def assert_same(content, whole):
    """The pixels are those of the whole picture, and so they are for OpenCV, which ignores damage."""
    np.testing.assert_array_equal(decode(content), decode(whole))
    decoded = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(decoded, decode(whole))


def before(content, marker, which=0, junk=JUNK):
    """The JPEG with other bytes before one of the markers of a kind, counted from the start of its data or header."""
    start = content.index(b"\xff\xda") if marker[1] in range(0xD0, 0xDA) else content.index(b"\xff\xdb")
    places = [each.start() for each in re.finditer(re.escape(marker), content) if each.start() >= start]
    return content[: places[which]] + junk + content[places[which] :]


def test_the_pictures_of_the_reports_are_read_by_the_program_and_have_the_pixels_of_the_whole_one(shared):
    folder = shared / "cases/jpeg"
    whole = (folder / "imageplain.jpg").read_bytes()
    for path in folder.glob("*.jpg"):
        assert_same(path.read_bytes(), whole)
    done = run("--camera", folder, "--fov", "90deg", "--height", "0.6")
    assert len(lines(done)) == len(list(folder.glob("*.jpg")))
    assert "damaged" not in done.stderr


@pytest.mark.parametrize("kind", ["rows", "short", "full color"])
@pytest.mark.parametrize("which", [0, 1, -1])
def test_bytes_before_a_restart_do_no_harm(kind, which):
    whole = ENCODED[kind]
    assert_same(before(whole, b"\xff\xd3", which), whole)
    assert_same(before(before(whole, b"\xff\xd0", 0), b"\xff\xd5", which, b"\0\0"), whole)


def test_bytes_before_every_restart_do_no_harm():
    whole = ENCODED["rows"]
    start = whole.index(b"\xff\xda")
    assert_same(whole[:start] + re.sub(rb"(\xff[\xd0-\xd7])", rb"1234\1", whole[start:]), whole)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("marker", [b"\xff\xc4", b"\xff\xda", b"\xff\xd9"], ids=["table", "scan", "end"])
def test_bytes_before_a_header_or_the_end_do_no_harm(kind, marker):
    assert_same(before(ENCODED[kind], marker), ENCODED[kind])


@settings(max_examples=30)
@given(st.sampled_from(["rows", "short"]), st.integers(0, 7), st.binary(min_size=1, max_size=9))
def test_any_bytes_that_are_no_marker_do_no_harm(kind, restart, junk):
    junk = junk.replace(b"\xff", b"\xfe")
    assert_same(before(ENCODED[kind], bytes([0xFF, 0xD0 + restart]), 0, junk), ENCODED[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_what_follows_the_end_does_no_harm(kind):
    whole = ENCODED[kind]
    for behind in (bytes(5000), bytes(range(256)) * 40, whole, whole[:3000]):
        assert_same(whole + behind, whole)


@pytest.mark.parametrize("kind", ["plain", "rows", "short"])
def test_a_missing_end_marker_does_no_harm_where_the_data_are_whole(kind):
    whole = ENCODED[kind]
    np.testing.assert_array_equal(decode(whole[:-2]), decode(whole))
    with pytest.raises(InputError, match="is cut short"):
        decode(whole[:-12])
    with pytest.raises(InputError, match="is cut short"):  # as a disk that was full leaves it
        decode(whole[: len(whole) // 2] + bytes(len(whole) // 2))


def test_a_progressive_picture_without_its_end_may_lack_details():
    whole = ENCODED["progressive"]
    scans = [each.start() for each in re.finditer(b"\xff\xda", whole)]
    for content in (whole[:-2], whole[: scans[4]]):
        with pytest.raises(InputError, match="is cut short"):
            decode(content)


def without(content, restart, count=60):
    """The JPEG without some bytes in the middle of the part behind a restart."""
    at = content.index(bytes([0xFF, 0xD0 + restart]), content.index(b"\xff\xda")) + 300
    return content[:at] + content[at + count :]


def test_damage_is_found_behind_harmless_bytes():
    """libjpeg warns only once about each picture."""
    spoiled = [each for each in range(1, 8) if "premature end" in fault(without(ENCODED["rows"], each))]
    assert spoiled
    for each in spoiled:
        for marker in (b"\xff\xd0", b"\xff\xc4", b"\xff\xda"):
            assert "premature end" in fault(before(without(ENCODED["rows"], each), marker))
    plain = ENCODED["plain"]
    half = plain[: len(plain) // 2].removesuffix(b"\xff") + plain[-2:]
    for harmless in (
        before(half, b"\xff\xc4"),
        half.replace(b"JFIF\0\1", b"JFIF\7\1", 1),  # an unknown version
        half.replace(b"\x00\x3f\x00", b"\x00\x3e\x00", 1),  # a wrong end of the scan's header
    ):
        assert "premature end" in fault(harmless)
        assert fault(harmless.replace(half[-40:], plain[len(plain) // 2 - 38 :])) == ""


def test_a_lost_restart_is_damage_behind_harmless_bytes():
    whole = before(ENCODED["rows"], b"\xff\xd0")
    start = whole.index(b"\xff\xd2")
    assert fault(whole[:start] + whole[whole.index(b"\xff\xd3") :])
    assert fault(whole) == ""


def test_bytes_that_are_left_over_because_pixels_got_lost_are_damage():
    """They follow bits that no encoder leaves unused."""
    whole, start = ENCODED["rows"], ENCODED["rows"].index(b"\xff\xd0")
    found = [fault(whole[:at] + bytes(40) + whole[at + 40 :]) for at in range(start, start + 8000, 100)]
    assert sum("left over" in each for each in found) >= 2


def fault(content):
    """Why a picture is refused; empty if it is not."""
    try:
        decode(content)
    except InputError as error:
        return str(error)
    return ""
