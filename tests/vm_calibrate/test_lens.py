"""vm-calibrate lens on pictures and videos of boards, drawn through a known lens."""

import math

import cv2
import numpy as np
import pytest

from vm_calibrate.boards import board_from
from vm_calibrate.frames import choose, find_boards
from vm_embedded.geometry.calibrated_lenses import BrownLens, FisheyeLens
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.radial_lenses import Rectilinear

from .films import KINDS, LENSES, SIZE, charuco_texture, chessboard_texture, film, run, write

BOARD = ("--board", "8x5")


def check(found, true):
    """A lens agrees with the true one: focal length, and pixels of rays up to where the board was seen."""
    assert found.scale == pytest.approx(true.scale, rel=0.005)
    y, x = np.mgrid[60:420:7j, 80:560:9j]
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    again = found.project(true.unproject(pixels, SIZE), SIZE)
    assert np.abs(again - pixels).max() < 0.5


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """A function that gives the folder of fifteen pictures of a chessboard for a kind of lens."""
    made = {}

    def folder(kind):
        if kind not in made:
            pictures = film(kind).pictures(15, chessboard_texture())
            made[kind] = write(tmp_path_factory.mktemp(kind) / "film", pictures)
        return made[kind]

    return folder


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_the_lens_of_pictures_is_found(kind, folders, tmp_path, capsys):
    printed = run(capsys, "lens", folders(kind), *BOARD, "--lens", kind, "-o", tmp_path / "lens.yaml")
    file = read_lens_file(tmp_path / "lens.yaml")
    assert type(file.lens) is type(LENSES[kind])
    assert file.orientation is None
    assert file.lens.size == SIZE
    check(file.lens, LENSES[kind])
    assert "focal length" in printed
    assert (tmp_path / "lens.yaml").read_text().startswith("# made by vm-calibrate\n# lens")


@pytest.mark.long
def test_the_kind_of_lens_is_chosen(folders, tmp_path, capsys):
    for kind, expected in (("pinhole", BrownLens), ("equidistant", FisheyeLens)):
        printed = run(capsys, "lens", folders(kind), *BOARD, "-o", tmp_path / "lens.yaml")
        assert printed.startswith("tried           pinhole")
        lens = read_lens_file(tmp_path / "lens.yaml").lens
        assert type(lens) is expected
        check(lens, LENSES[kind])


@pytest.mark.long
def test_a_charuco_video(tmp_path, capsys):
    camera = film("rectilinear")
    pictures = camera.pictures(15, charuco_texture())
    video = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 15.0, SIZE)
    for picture in (*pictures, np.full_like(pictures[0], 110)):
        video.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    video.release()
    board = ("--board", "9x6", "--square", "0.08", "--charuco", "dict_4x4_50", "--marker", "0.06")
    command = ("lens", tmp_path / "film.avi", *board, "--lens", "rectilinear", "--fov", "100deg")
    printed = run(capsys, *command, "-o", tmp_path / "lens.yaml")
    lens = read_lens_file(tmp_path / "lens.yaml").lens
    assert isinstance(lens, Rectilinear)
    assert lens.fov == pytest.approx(math.radians(100.0))
    check(lens, LENSES["rectilinear"])
    assert "15 used" in printed
    assert "1 without the board" in printed


@pytest.mark.long
def test_blurred_and_broken_frames_are_left_out(tmp_path):
    sharp = film("rectilinear").pictures(9, chessboard_texture())[6:]
    smeared = cv2.filter2D(sharp[0], -1, np.full((1, 7), 1 / 7, np.float32))
    folder = write(tmp_path / "film", [smeared, *sharp])
    (folder / "broken.png").write_bytes(b"no picture")
    search = find_boards(str(folder), board_from("8x5", 0.08))
    assert [each.blur for each in search.sightings] == pytest.approx([7.0, 2.6, 2.6, 2.6], abs=0.5)
    assert [each.name for each in choose(search, 10)] == ["001.png", "002.png", "003.png"]
    assert search.left_out == {"blurred": 1, "unreadable": 1, "similar to others": 0}


@pytest.mark.long
def test_a_wrong_board_size_names_the_right_one(folders, tmp_path, capsys):
    command = ("lens", folders("rectilinear"), "--board", "9x6", "-o", tmp_path / "lens.yaml")
    assert "try --board 8x5" in run(capsys, *command, code=1)
    assert not (tmp_path / "lens.yaml").exists()


def test_pictures_without_a_board_are_an_error(tmp_path, capsys):
    folder = write(tmp_path / "film", [np.full((480, 640), 90, np.uint8)] * 2)
    output = ("-o", tmp_path / "lens.yaml")
    assert "none of 2 frames of film shows a chessboard with 8x5" in run(
        capsys, "lens", folder, *BOARD, *output, code=1
    )
    (alone, _) = sorted(folder.iterdir())
    assert f"no frame of {alone.name} shows a chessboard" in run(capsys, "lens", alone, *BOARD, *output, code=1)
    charuco = ("--board", "9x6", "--square", "0.04", "--charuco", "4X4_50", "--marker", "0.03")
    assert "check --charuco" in run(capsys, "lens", folder, *charuco, *output, code=1)


def test_another_pattern_of_markers_is_an_error_with_advice(tmp_path, capsys):
    folder = write(tmp_path / "film", [film("rectilinear").pictures(1, charuco_texture())[0]])
    board = ("--board", "8x8", "--square", "0.08", "--charuco", "4X4_50", "--marker", "0.06", "--legacy")
    said = run(capsys, "lens", folder, *board, "-o", tmp_path / "lens.yaml", code=1)
    assert "22 markers of 4X4_50 are visible; --board counts squares: try --board 9x6\n" in said


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("size", ["8x8", "5x7", "7x10", "6x4", "12x8"])
def test_the_size_of_a_charuco_board_is_told_from_its_markers(size, legacy):
    real = board_from(size, 0.03, "4X4_50", 0.022, legacy)
    drawn = real._board.generateImage((100 * real.columns, 100 * real.rows), marginSize=40)
    oblique = np.array([[0.8, 0.15, 30.0], [-0.05, 0.7, 60.0], [0.0002, 0.0003, 1.0]])
    picture = cv2.warpPerspective(drawn, oblique, (1000, 1000), borderValue=255)
    assert real.other_size(picture) is None
    for wrong in ("9x6", "4x4", "6x9"):
        told = board_from(wrong, 0.03, "4X4_50", 0.022, legacy).other_size(picture)
        assert told == size, (wrong, told)
        assert board_from(wrong, 0.03, "4X4_50", 0.022, legacy).marker_count(picture) == real.columns * real.rows // 2


def test_too_few_frames_are_an_error(tmp_path, capsys):
    folder = write(tmp_path / "film", film("rectilinear").pictures(3, chessboard_texture()))
    printed = run(capsys, "lens", folder, *BOARD, "-o", tmp_path / "lens.yaml", code=1)
    assert "in at least 5 usable frames" in printed


def test_pictures_of_two_sizes_are_an_error(tmp_path, capsys):
    folder = write(tmp_path / "film", [np.zeros((480, 640), np.uint8), np.zeros((480, 600), np.uint8)])
    assert "001.png has 600 x 480 px" in run(capsys, "lens", folder, *BOARD, "-o", tmp_path / "lens.yaml", code=1)
