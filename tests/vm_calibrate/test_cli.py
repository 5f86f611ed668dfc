"""vm-calibrate as a user types it."""

import json
import os
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.programs import BIN
from vm_calibrate.boards import DICTIONARIES, board_from
from vm_calibrate.cli import LENS_NAMES
from vm_calibrate.lens_kinds import LENS_KINDS
from vm_embedded.errors import InputError

from .films import run, write
from .test_kalibr import CAMCHAIN


def call(*arguments, **variables):
    return subprocess.run(
        [BIN / "vm-calibrate", *arguments], capture_output=True, text=True, env=os.environ | variables
    )


@pytest.mark.long
def test_help_and_unknown_commands_as_a_process():
    listed = call("--help")
    assert listed.returncode == 0
    assert all(name in listed.stdout for name in ("board", "lens", "kalibr", "pose"))
    assert call().returncode == 2
    wrong = call("lends")
    assert wrong.returncode == 2
    assert "did you mean 'lens'" in wrong.stderr


def test_scipy_that_is_missing_is_one_line(tmp_path):
    (tmp_path / "scipy.py").write_text("raise ModuleNotFoundError('no', name='scipy.optimize')")
    balls = [{"cx": 90, "cy": 80, "r_px": 9, "radius": 0.1}] * 3
    (tmp_path / "balls.json").write_text(json.dumps({"a.jpg": balls}))
    lens = "projection: equisolid\nfocal_length: 90.0\nfov: 2.0\nsize: [200, 200]\n"
    (tmp_path / "lens.yaml").write_text(lens)
    search = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = ("pose", "--balls", str(tmp_path / "balls.json"), "--lens", str(tmp_path / "lens.yaml"))
    done = call(*command, "-o", str(tmp_path / "new.yaml"), PYTHONPATH=search)
    assert done.returncode == 1
    assert done.stderr == (
        "vm-calibrate: scipy is not installed; run: pip install '.[calibrate]' in the folder of vm-embedded\n"
    )


def test_the_command_line_knows_the_kinds_of_lenses():
    assert ("auto", *LENS_KINDS) == LENS_NAMES


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("9",), "--board must be COLUMNSxROWS"),
        (("9x2",), "--board must be COLUMNSxROWS from 3 to 999 each"),
        (("1000x6",), "--board must be COLUMNSxROWS from 3 to 999 each"),
        (("9x6", "--square", "0"), "--square must be a length above 0 m"),
        (("9x6", "--square", "nan"), "--square must be a length above 0 m"),
        (("9x6", "--square", "30"), "--square must be a length in meters, at most 1, not 30; 30 mm are 0.03"),
        (("9x6", "--marker", "0.02"), "--marker and --legacy belong to a ChArUco board"),
        (("9x6", "--charuco", "4X4_50"), "a ChArUco board needs --square and --marker"),
        (("9x6", "--square", "1", "--charuco", "4X4_50"), "a ChArUco board needs --marker"),
        (("9x6", "--square", "1", "--charuco", "4X4_50", "--marker", "2"), "--marker 2 must be below --square 1"),
        (("9x6", "--square", "1", "--charuco", "4x4_5", "--marker", "0.7"), "unknown --charuco dictionary '4x4_5'"),
        (("20x20", "--square", "1", "--charuco", "4X4_50", "--marker", "0.7"), "needs 200 markers, but 4X4_50 has 50"),
        (("9x6", "--fov", "100deg"), "--fov is for a radial lens"),
        (("9x6", "--lens", "equidistant", "--fov", "400deg"), "must be above 0 and up to 360deg, not 400deg"),
        (("9x6", "--lens", "rectilinear", "--fov", "190deg"), "must be above 0 and below 180deg, not 190deg"),
    ],
)
def test_wrong_options_of_a_board_are_one_line(arguments, problem, tmp_path, capsys):
    folder = write(tmp_path / "film", [np.zeros((480, 640), np.uint8)])
    printed = run(capsys, "lens", folder, "--board", *arguments, "-o", tmp_path / "lens.yaml", code=1)
    assert problem in printed
    assert printed.count("\n") == 1


def test_sources_that_can_not_be_read_are_one_line(tmp_path, capsys):
    def problem(source):
        return run(capsys, "lens", source, "--board", "9x6", "-o", tmp_path / "lens.yaml", code=1)

    assert "no such image" in problem(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    assert "no images in directory" in problem(tmp_path / "empty")
    (tmp_path / "film.mp4").write_bytes(b"no film")
    assert "nor a video that OpenCV can read" in problem(tmp_path / "film.mp4")
    folder = write(tmp_path / "film", [np.zeros((480, 640), np.uint8)])
    (folder / "000.png").write_bytes((folder / "000.png").read_bytes()[:60])
    assert "has no frame that can be read" in problem(folder)


def test_a_result_that_can_not_be_written_is_known_before_the_work(tmp_path, capsys):
    folder = write(tmp_path / "film", [np.zeros((480, 640), np.uint8)])
    printed = run(capsys, "lens", folder, "--board", "9x6", "-o", tmp_path / "no" / "lens.yaml", code=1)
    assert "there is no folder" in printed


def test_an_error_keeps_the_lens_file(tmp_path, capsys):
    (tmp_path / "camchain.yaml").write_text(CAMCHAIN)
    output = tmp_path / "lens.yaml"
    run(capsys, "kalibr", tmp_path / "camchain.yaml", "--camera", "cam0", "-o", output)
    before = output.read_text()
    run(capsys, "kalibr", tmp_path / "camchain.yaml", "--camera", "cam2", "-o", output, code=1)
    assert output.read_text() == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["camchain.yaml", "lens.yaml"]


def test_dictionaries_are_those_of_opencv():
    assert {"4X4_50", "6X6_250", "ARUCO_ORIGINAL", "APRILTAG_36H11"} <= set(DICTIONARIES)
    for name in DICTIONARIES:
        assert board_from("3x3", 1.0, name, 0.5).dictionary == name
    with pytest.raises(InputError, match="did you mean"):
        board_from("3x3", 1.0, "4X4_500", 0.5)


def test_a_legacy_board_is_found_with_its_option(tmp_path):
    board = board_from("8x8", 1.0, "4X4_50", 0.75, legacy=True)
    drawn = np.pad(board._board.generateImage((480, 480)), 20, constant_values=255)
    assert len(board.find(drawn).pixels) == 49
    found = board_from("8x8", 1.0, "4X4_50", 0.75).find(drawn)
    assert found is None or len(found.pixels) < 49


@pytest.mark.parametrize(
    "options",
    [
        ("8x5", "--square", "0.03"),
        ("8x6", "--square", "0.03", "--charuco", "5X5_100", "--marker", "0.022"),
        ("8x8", "--square", "0.03", "--charuco", "4X4_50", "--marker", "0.02", "--legacy"),
    ],
)
def test_a_drawn_board_is_found(options, tmp_path, capsys):
    assert "a square has 30 mm" in run(capsys, "board", "--board", *options, "-o", tmp_path / "board.svg")
    root = ElementTree.parse(tmp_path / "board.svg").getroot()
    _, _, width, height = (float(each) for each in root.get("viewBox").split())
    assert root.get("width") == f"{width:g}mm"
    drawn = np.full((round(4 * height), round(4 * width)), 255, np.uint8)
    for each in root.iter("{http://www.w3.org/2000/svg}rect"):
        x, y, w, h = (float(each.get(name)) for name in ("x", "y", "width", "height"))
        drawn[round(4 * y) : round(4 * (y + h)), round(4 * x) : round(4 * (x + w))] = 0
    lengths = dict(zip(options[1::2], options[2::2], strict=False))
    marker = float(lengths["--marker"]) if "--marker" in lengths else None
    board = board_from(options[0], 0.03, lengths.get("--charuco"), marker, "--legacy" in options)
    corners = board.find(drawn)
    assert len(corners.pixels) == {"8x5": 40, "8x6": 35, "8x8": 49}[options[0]]
    steps = np.diff(corners.pixels[:4, 0])
    assert np.abs(steps) == pytest.approx(120.0, abs=0.6)


def test_a_board_needs_its_size_and_the_right_kind_of_file(tmp_path, capsys):
    board = ("board", "--board", "9x6")
    assert "give --square in meters" in run(capsys, *board, "-o", tmp_path / "a.svg", code=1)
    assert "ends in .svg" in run(capsys, *board, "--square", "0.03", "-o", tmp_path / "a.pdf", code=1)


def test_a_lens_file_in_yaml_is_not_named_like_one_in_toml(tmp_path, capsys):
    said = run(capsys, "lens", tmp_path, "--board", "9x6", "-o", tmp_path / "lens.toml", code=1)
    assert "lens.toml must end in .yaml: the lens file is YAML" in said
