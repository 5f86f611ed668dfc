"""Films that are damaged, end early, or have no length or times."""

import struct
from collections import Counter

import cv2
import numpy as np
import pytest

from tests.programs import run_program
from tests.vm_embedded.cli.commands import lines, run
from vm_calibrate.frames import _sharp_frames
from vm_embedded.cameras.camera import BrokenFrameError, CameraSettings
from vm_embedded.cameras.image_files import open_source, open_sources
from vm_embedded.cameras.open_camera import FileCamera
from vm_embedded.errors import InputError

VIEW = ("--fov", "60deg", "--height", "0.6")
COUNT, RATE = 40, 10.0


@pytest.fixture(scope="module")
def pictures():
    """Frames of a film: a square that moves over noise."""
    noise = np.random.default_rng(0).integers(0, 256, (96, 128, 3)).astype(np.uint8)
    found = [noise.copy() for _ in range(COUNT)]
    for at, each in enumerate(found):
        each[20:50, 2 * at : 2 * at + 30] = 255
    return found


def film(path, pictures, codec):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), RATE, pictures[0].shape[1::-1])
    assert writer.isOpened()
    for each in pictures:
        writer.write(each)
    writer.release()
    return path


def read(path):
    """Stamps of the frames that can be read, how many can't, and the remarks."""
    source, stamps, lost = open_source(str(path)), [], 0
    for index, frame in enumerate(source.frames):
        assert frame.index == index
        try:
            frame.read()
            stamps.append(frame.stamp)
        except InputError:
            lost += 1
    return stamps, lost, list(source.remarks())


@pytest.mark.long
def test_the_damaged_film_of_the_report_is_read_to_its_end(shared, tmp_path):
    folder = shared / "cases/video"
    stamps, lost, (remark,) = read(folder / "damaged-5-percent.mp4")
    assert (len(stamps), stamps[-1]) == (44, 4.7)
    assert lost + len(stamps) == 48
    assert "44 of 48 frames" in remark
    stamps, lost, remarks = read(folder / "good.mp4")
    assert (stamps, lost, remarks) == (pytest.approx(np.arange(48) / 10), 0, [])
    done = run("--camera", folder / "damaged-5-percent.mp4", *VIEW)
    assert len(lines(done)) == 44
    assert "damaged-5-percent.mp4: 44 of 48 frames could be read" in done.stderr
    done = run("--camera", folder / "good.mp4", folder / "damaged-5-percent.mp4", *VIEW)
    assert len(lines(done)) == 92
    assert "44 of 48 frames" in done.stderr


@pytest.mark.parametrize(
    ("name", "codec"), [("a.avi", "MJPG"), ("a.mkv", "mp4v"), ("a.mp4", "mp4v"), ("a.webm", "VP80")]
)
def test_a_whole_film_has_no_remark(tmp_path, pictures, name, codec):
    stamps, lost, remarks = read(film(tmp_path / name, pictures, codec))
    assert (len(stamps), lost, remarks) == (COUNT, 0, [])
    np.testing.assert_allclose(stamps, np.arange(COUNT) / RATE, atol=2e-3)


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "MJPG"), ("a.mkv", "MJPG"), ("a.ivf", "VP80")])
def test_a_film_that_ends_early_says_how_many_frames_are_missing(tmp_path, pictures, name, codec):
    path = film(tmp_path / name, pictures, codec)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    stamps, _, remarks = read(path)
    assert 0.4 * COUNT < len(stamps) < 0.6 * COUNT
    source = open_source(str(path))
    if source.count is None:  # the length is unknown
        assert remarks == []
    else:
        assert f"{len(stamps)} of {COUNT} frames" in remarks[0]


def test_a_film_is_read_on_behind_damage_also_live(tmp_path, pictures):
    path = film(tmp_path / "film.mp4", pictures, "mp4v")
    content = bytearray(path.read_bytes())
    start, size = content.index(b"mdat") + 4, len(content)
    at = start + (size - start) // 3
    content[at : at + (size - start) // 10] = bytes((size - start) // 10)
    path.write_bytes(content)
    stamps, lost, _ = read(path)
    assert stamps[-1] == pytest.approx((COUNT - 1) / RATE)
    assert len(stamps) + lost >= COUNT - 2
    camera, shots, broken = FileCamera(CameraSettings(source=str(path), fps=1000)), 0, 0
    while True:
        try:
            if camera.read() is None:
                break
            shots += 1
        except BrokenFrameError:
            broken += 1
    assert (shots, broken) == (len(stamps), lost)


@pytest.mark.long
def test_a_board_is_found_in_a_film_without_a_length(shared, tmp_path):
    board = shared / "cases/video/board.webm"
    done = run_program("vm-calibrate", "lens", board, "--board", "9x6", "-o", tmp_path / "lens.yaml")
    assert "30 used" in done.stdout


def test_a_film_without_a_length_is_read_to_its_end(shared, tmp_path, pictures):
    raw = tmp_path / "film.mjpeg"
    raw.write_bytes(b"".join(cv2.imencode(".jpg", each)[1].tobytes() for each in pictures))
    for path, count in ((shared / "cases/video/board.webm", 30), (raw, COUNT)):
        assert open_source(str(path)).count is None
        assert len(read(path)[0]) == count
        names = [name for name, _ in _sharp_frames(str(path), Counter())]
        assert names == [f"frame {index}" for index in range(count)]


def raw_h264(film):
    """The stream of an MP4 file as a camera writes it: without times and without a length."""
    at = film.index(b"avcC") + 4
    parameters, place = [], at + 5
    for _ in range(2):
        for _ in range(film[place] & 31):
            (length,) = struct.unpack_from(">H", film, place + 1)
            parameters.append(film[place + 3 : place + 3 + length])
            place += 2 + length
        place += 1
    place = film.index(b"mdat") + 4
    end = place - 8 + struct.unpack_from(">I", film, place - 8)[0]
    units = []
    while place < end:
        (length,) = struct.unpack_from(">I", film, place)
        units.append(film[place + 4 : place + 4 + length])
        place += 4 + length
    return b"".join(b"\0\0\0\1" + each for each in parameters + units)


def test_a_raw_stream_gets_times_from_its_rate_and_a_remark(shared, tmp_path):
    path = tmp_path / "stream.h264"
    path.write_bytes(raw_h264((shared / "cases/video/good.mp4").read_bytes()))
    stamps, lost, (remark,) = read(path)
    assert (len(stamps), lost) == (48, 0)
    assert (np.diff(stamps) > 0.0).all()
    assert "frames per second" in remark
    done = run("--camera", path, *VIEW)
    assert [each["stamp"] for each in lines(done)] == pytest.approx(stamps)
    assert "does not tell the times of its frames" in done.stderr


def test_times_that_run_backward_are_counted_on(tmp_path, pictures):
    """FFmpeg gives the last frame of a raw stream of MPEG-2 the time 0."""
    path = film(tmp_path / "film.m2v", pictures, "MPG2")
    stamps, _, (remark,) = read(path)
    assert (np.diff(stamps) > 0.0).all()
    assert "times" in remark


def test_remarks_of_several_sources_are_all_said(tmp_path, pictures):
    path = film(tmp_path / "film.m2v", pictures, "MPG2")
    source = open_sources([str(path), str(path)])
    assert len(list(source.frames)) == 2 * COUNT
    assert len(source.remarks()) == 2
