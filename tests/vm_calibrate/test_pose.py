"""vm-calibrate pose: boards on the floor that are drawn, and balls whose outlines are computed."""

import json
import math
import re
from collections import defaultdict

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_embedded.strategies import lenses, reals, seeds
from vm_calibrate import ball_fit
from vm_calibrate.ball_fit import fit_balls
from vm_calibrate.balls import SeenBall, read_balls
from vm_calibrate.cli import main
from vm_calibrate.shared_fit import fit_shared
from vm_embedded.cli import detect
from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import format_lens_file, read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_workstation.outlines import polygon_area, sphere_outline

from .films import KINDS, LENSES, SIZE, chessboard_texture, film, run, write

CAMERA = Orientation.from_roll_pitch(0.8, roll=0.06, pitch=0.7)
BOARD = ("--board", "8x5", "--square", "0.08", "--thickness", "0.005")
RADIUS = 0.1
SPOTS = [(away, math.radians(side)) for away in (0.7, 1.2, 2.5, 5.0) for side in (-50, -25, 0, 25, 50)]


def check(found, true):
    """The limits that a user may expect."""
    assert found.height == pytest.approx(true.height, rel=0.02)
    assert math.degrees(found.pitch) == pytest.approx(math.degrees(true.pitch), abs=0.3)
    assert math.degrees(found.roll) == pytest.approx(math.degrees(true.roll), abs=0.3)


def lens_file(folder, lens, orientation=None):
    """Write a lens file and return its path."""
    path = folder / "true.yaml"
    path.write_text(format_lens_file(lens, orientation))
    return path


def outline(lens, camera, away, side, radius=RADIUS):
    """The outline (256, 2) of a ball at a distance [m] and bearing [rad] on the floor; None outside the picture."""
    heading = side + camera.yaw
    center = np.array([away * math.cos(heading), away * math.sin(heading), radius])
    pixels = sphere_outline(lens, camera, center, radius, SIZE)
    inside = np.isfinite(pixels).all() and (pixels > 3).all() and (pixels < np.array(SIZE) - 4).all()
    return pixels if inside else None


def seen_ball(name, pixels, random, box, noise, radius=RADIUS):
    """A ball as it is measured, with noise [px] of the edges of its box or of 32 points of its outline."""
    if box:
        measured = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]) + random.normal(0.0, noise, 4)
    else:
        # Area and center of the true outline, and the means of the errors of the points.
        moments = cv2.moments(pixels.astype(np.float32).reshape(-1, 1, 2))
        center = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
        measured = np.array([*center, math.sqrt(polygon_area(pixels) / math.pi)])
        measured += random.normal(0.0, noise / math.sqrt(32 / 2.0) * np.array([1.0, 1.0, math.sqrt(0.5)]))
    return SeenBall(name, radius, measured)


def seen_balls(lens, camera, random, box=False, noise=1.0, spots=SPOTS, each=6, radius=RADIUS):
    """Balls around each spot, as they are measured."""
    made = []
    for away, side in spots * each:
        pixels = outline(lens, camera, away * random.uniform(0.8, 1.2), side + random.uniform(-0.2, 0.2), radius)
        if pixels is not None:
            made.append(seen_ball(f"ball {len(made)}", pixels, random, box, noise, radius))
    return made


@pytest.mark.parametrize("kind", KINDS)
def test_the_pose_over_a_board_is_found(kind, tmp_path, capsys):
    spots = ((0.8, 0.0, 0.3), (1.2, -0.3, -0.7), (1.0, 0.3, 1.9))
    pictures = [film(kind).on_floor(CAMERA, *spot, chessboard_texture(), thickness=0.005) for spot in spots]
    folder = write(tmp_path / "floor", pictures)
    output = tmp_path / "lens.yaml"
    printed = run(capsys, "pose", folder, "--lens", lens_file(tmp_path, LENSES[kind]), *BOARD, "-o", output)
    file = read_lens_file(output)
    check(file.orientation, CAMERA)
    assert file.lens == read_lens_file(tmp_path / "true.yaml").lens
    assert re.search("used [123], left out 0", printed)


@pytest.mark.parametrize("box", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.parametrize("kind", LENSES)
@settings(max_examples=2)
@given(height=reals(0.5, 1.5), pitch=reals(0.2, 0.8), roll=reals(-0.2, 0.2), seed=seeds)
def test_the_pose_over_balls_is_found(kind, box, height, pitch, roll, seed):
    true = Orientation.from_roll_pitch(height, roll=roll, pitch=pitch)
    spots = [(away * height, side) for away, side in SPOTS]
    noise, radius = (0.5 if box else 1.0), 0.12 * height
    balls = seen_balls(LENSES[kind], true, np.random.default_rng(seed), box, noise, spots, radius=radius)
    check(fit_balls(balls, LENSES[kind], SIZE).orientation, true)


@pytest.mark.long
@settings(max_examples=15)
@given(lens=lenses(0.2), pitch=reals(0.2, 0.8), roll=reals(-0.2, 0.2), box=st.booleans(), seed=seeds)
def test_the_true_pose_is_within_the_stated_uncertainty(lens, pitch, roll, box, seed):
    true = Orientation.from_roll_pitch(0.8, roll=roll, pitch=pitch)
    balls = seen_balls(lens, true, np.random.default_rng(seed), box)
    if len(balls) < 12:
        return  # such a lens sees too little of the floor
    fit = fit_balls(balls, lens, SIZE)
    assert abs(fit.orientation.height - 0.8) < 5.0 * fit.height
    assert abs(fit.orientation.pitch - pitch) < 5.0 * fit.pitch
    assert abs(fit.orientation.roll - roll) < 5.0 * fit.roll
    assert not fit.left_out


@pytest.mark.long
@settings(max_examples=5)
@given(seed=seeds)
def test_balls_that_are_not_on_the_floor_are_left_out(seed):
    random = np.random.default_rng(seed)
    balls = seen_balls(LENSES["equidistant"], CAMERA, random, each=2)
    hidden = balls[4].measured * (1.0, 1.0, 0.6)
    balls[4] = SeenBall("half hidden", RADIUS, hidden)
    fit = fit_balls(balls, LENSES["equidistant"], SIZE)
    assert list(fit.left_out) == ["half hidden"]
    check(fit.orientation, CAMERA)


@pytest.mark.long
def test_of_many_balls_a_twentieth_is_left_out_before_the_next_fit(monkeypatch):
    balls = seen_balls(LENSES["equidistant"], CAMERA, np.random.default_rng(2), each=4)[:60]
    hidden = sorted(range(60), key=lambda at: -balls[at].size)[:18:3]
    for at in hidden:
        balls[at] = SeenBall(f"hidden {at}", RADIUS, balls[at].measured * (1.0, 1.0, 0.6))
    fits = []
    monkeypatch.setattr(ball_fit, "fit_shared", lambda *given: fits.append(given) or fit_shared(*given))
    fit = fit_balls(balls, LENSES["equidistant"], SIZE)
    assert set(fit.left_out) == {f"hidden {at}" for at in hidden}
    check(fit.orientation, CAMERA)
    assert len(fits) <= 2 * 4, "two starts each: of 60, 57, and perhaps 55 balls, and of those that are left"


def test_a_fit_shows_its_progress(monkeypatch, capsys):
    monkeypatch.setattr("vm_embedded.cli.progress._LINE_INTERVAL", 0.0)
    balls = seen_balls(LENSES["equidistant"], CAMERA, np.random.default_rng(3), each=1)
    fit_balls(balls, LENSES["equidistant"], SIZE)
    assert re.search(
        r"^vm-calibrate: \d+/200 steps, .*, most fits need far fewer steps$", capsys.readouterr().err, re.MULTILINE
    )


def test_balls_at_one_place_are_not_enough_and_the_warning_says_what_is():
    spots = [(3.0, math.radians(side)) for side in (-4, -2, 0, 2, 4)]
    balls = seen_balls(LENSES["rectilinear"], CAMERA_AHEAD, np.random.default_rng(1), spots=spots, each=1)
    fit = fit_balls(balls, LENSES["rectilinear"], SIZE)
    assert any(each.startswith("the height is only known to") for each in fit.warnings)
    assert any("m away: add some nearer, farther, and to both sides" in each for each in fit.warnings)


CAMERA_AHEAD = Orientation.from_roll_pitch(0.8, pitch=0.2)


def test_too_few_balls_are_an_error():
    balls = seen_balls(LENSES["equisolid"], CAMERA, np.random.default_rng(1))[:2]
    with pytest.raises(InputError, match="at least 3 whole balls on the floor, better 10, but there are 2"):
        fit_balls(balls, LENSES["equisolid"], SIZE)


@pytest.mark.long
def test_balls_at_the_edge_of_the_picture_are_left_out():
    balls = seen_balls(LENSES["equisolid"], CAMERA, np.random.default_rng(1))
    cut = SeenBall("cut", RADIUS, np.array([10.0, 200.0, 40.0]))
    assert fit_balls([*balls, cut], LENSES["equisolid"], SIZE).left_out == {"cut": "cut off by the edge of the picture"}


@pytest.fixture
def yolo(tmp_path):
    """A folder of pictures with boxes in YOLO files, balls as class 0, and the lens file of their camera."""
    balls = seen_balls(LENSES["equidistant"], CAMERA, np.random.default_rng(3), box=True, noise=0.2, each=3)
    folder = write(tmp_path / "balls", [np.zeros((480, 640), np.uint8)] * 2)
    shares = [np.concatenate([each.middle + 0.5, each.measured[2:] - each.measured[:2]]) for each in balls]
    lines = [f"0 {x / 640} {y / 480} {w / 640} {h / 480}" for x, y, w, h in shares]
    (folder / "000.txt").write_text("\n".join(lines[::2]) + "\n7 0.5 0.5 0.2 0.3\n")
    (folder / "001.txt").write_text("\n".join(lines[1::2]) + "\n\n")
    return folder, lens_file(tmp_path, LENSES["equidistant"])


def test_boxes_of_yolo_files(yolo, tmp_path, capsys):
    folder, lens = yolo
    command = ("pose", "--lens", lens, "--balls", folder, "--radius", RADIUS)
    run(capsys, *command, "--label", "0", "-o", tmp_path / "lens.yaml")
    check(read_lens_file(tmp_path / "lens.yaml").orientation, CAMERA)
    assert "unknown --label '1' (allowed: 0, 7)" in run(
        capsys, *command, "--label", "1", "-o", tmp_path / "x.yaml", code=1
    )
    (folder / "001.txt").write_text("0 0.5 0.5 0.1\n")
    assert "001.txt line 1: '0 0.5 0.5 0.1' has 4 values" in run(capsys, *command, "-o", tmp_path / "x.yaml", code=1)


def test_a_table_of_names_and_labels_beside_the_folder_of_images(yolo, tmp_path, capsys):
    folder, lens = yolo
    (tmp_path / "labels").mkdir()
    for text in folder.glob("*.txt"):
        text.rename(tmp_path / "labels" / text.name)
    folder = folder.rename(tmp_path / "images")
    (tmp_path / "classes.txt").write_text("\n".join(["ball", *"123456", "robot"]))
    command = ("pose", "--lens", lens, "--balls", folder, "--radius", RADIUS, "-o", tmp_path / "lens.yaml")
    run(capsys, *command, "--label", "ball")
    check(read_lens_file(tmp_path / "lens.yaml").orientation, CAMERA)
    assert "unknown --label '0' (allowed: ball, robot)" in run(capsys, *command, "--label", "0", code=1)


def test_the_lens_file_may_be_completed_in_place(yolo, capsys):
    folder, lens = yolo
    before = read_lens_file(lens)
    run(capsys, "pose", "--lens", lens, "--balls", folder, "--radius", RADIUS, "--label", "0", "-o", lens)
    assert read_lens_file(lens).lens == before.lens
    assert read_lens_file(lens).orientation is not None
    assert detect.main(["--camera", str(folder / "000.png"), "--lens", str(lens)]) == 0


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "is not JSON"),
        ("[]", "must map names of pictures to lists"),
        ('{"a.jpg": [3]}', "a.jpg, ball 1 must be a table"),
        ('{"a.jpg": [{"cx": 1, "cy": 2}]}', "a.jpg, ball 1 has no 'r_px'"),
        ('{"a.jpg": [{"cx": 1, "cy": "2", "r_px": 3}]}', "cy of a.jpg, ball 1 must be a number"),
        (f'{{"a.jpg": [{{"cx": 1, "cy": {10**400}, "r_px": 3}}]}}', "cy of a.jpg, ball 1 must be a number"),
        ('{"a.jpg": [{"cx": 1, "cy": 2, "r_px": 3}]}', "has no radius in meters; give --radius"),
        ('{"a.jpg": [{"cx": 1, "cy": 2, "r_px": -3, "radius": 0.1}]}', "is not larger than nothing"),
        ('{"a.jpg": [{"x0": 9, "y0": 2, "x1": 8, "y1": 4, "radius": 0.1}]}', "is not larger than nothing"),
        (
            '{"a.jpg": [{"x0": 1, "y0": 2, "x1": 8, "y1": 4, "radius": 0.1}, '
            '{"cx": 1, "cy": 2, "r_px": 3, "radius": 0.1}]}',
            "outlines and boxes",
        ),
        ('{"a.jpg": []}', "has no balls"),
        (
            '{"a.jpg": [{"cx": 1, "cy": 2, "r_px": 3, "radius": 1, "class": "ball"}, {"class": "robot"}]}',
            "has the classes ball, robot; choose one with --label",
        ),
    ],
)
def test_a_wrong_file_of_balls_is_one_line(content, problem, tmp_path, capsys):
    (tmp_path / "balls.json").write_text(content)
    lens = lens_file(tmp_path, LENSES["equisolid"])
    command = ("pose", "--lens", lens, "--balls", tmp_path / "balls.json", "-o", tmp_path / "lens.yaml")
    printed = run(capsys, *command, code=1)
    assert problem in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "lens.yaml").exists()


@pytest.mark.parametrize(
    ("radius", "problem"),
    [
        (0.0, "must be a length above 0 m"),
        (math.nan, "must be a length above 0 m"),
        (11.0, "must be a length in meters, at most 1, not 11; 11 cm are 0.11, 11 mm are 0.011"),
    ],
)
def test_a_wrong_radius_is_explained(radius, problem, tmp_path):
    with pytest.raises(InputError, match=problem):
        read_balls(tmp_path, radius, None, (640, 480))


def test_the_label_chooses_the_balls_of_a_json_file(tmp_path):
    ball = {"cx": 1, "cy": 2, "r_px": 3, "radius": 0.1}
    path = tmp_path / "balls.json"
    path.write_text(json.dumps({"a.jpg": [{**ball, "class": "ball"}, {"class": "robot"}], "b.jpg": [ball]}))
    balls, _ = read_balls(path, None, "ball", (640, 480))
    assert [each.name for each in balls] == ["a.jpg, ball 1"]
    with pytest.raises(InputError, match=r"unknown --label 'cup' .*ball, robot"):
        read_balls(path, None, "cup", (640, 480))
    path.write_text(json.dumps({"a.jpg": [ball]}))
    with pytest.raises(InputError, match="has no classes; leave out --label"):
        read_balls(path, None, "ball", (640, 480))


def test_options_that_do_not_belong_together_are_errors(tmp_path, capsys):
    lens = lens_file(tmp_path, LENSES["equisolid"])
    pose = ("pose", "--lens", lens, "-o", tmp_path / "lens.yaml")
    assert "give --balls, or --board" in run(capsys, *pose, code=1)
    assert "--board needs SOURCE" in run(capsys, *pose, "--board", "8x5", code=1)
    assert "--balls needs no SOURCE" in run(capsys, *pose, tmp_path, "--balls", tmp_path, code=1)
    assert "give --radius" in run(capsys, *pose, "--balls", tmp_path, code=1)
    assert "no picture with a label file NAME.txt" in run(capsys, *pose, "--balls", tmp_path, "--radius", "0.1", code=1)
    assert "--radius must be a length" in run(capsys, *pose, "--balls", tmp_path, "--radius", "-1", code=1)
    pictures = run(capsys, *pose, "--balls", tmp_path, "--radius", "0.1", "--square", "0.1", "--legacy", code=1)
    assert "--balls does not use --square, --legacy; leave out" in pictures
    folder = write(tmp_path / "floor", [np.zeros((480, 640), np.uint8)])
    board = run(capsys, *pose, folder, "--board", "8x5", "--square", "0.1", "--radius", "0.1", code=1)
    assert "--board does not use --radius; leave out" in board
    assert "the size of the board is missing" in run(capsys, *pose, folder, "--board", "8x5", code=1)


def test_the_size_of_the_pictures_can_be_given(tmp_path, capsys):
    path, lens = tmp_path / "balls.json", tmp_path / "lens.yaml"
    path.write_text(json.dumps({"a.jpg": [{"cx": 90, "cy": 80, "r_px": 9, "radius": 0.1}] * 3}))
    lens.write_text("projection: equisolid\nfocal_length: 90.0\nfov: 2.0\n")
    command = ("pose", "--lens", lens, "--balls", path, "-o", tmp_path / "new.yaml")
    assert "give --size, or add an entry" in run(capsys, *command, code=1)
    assert main([*map(str, command), "--size", "200x200"]) == 0
    assert "warning: the height is not determined; the balls are" in capsys.readouterr().err


def test_the_height_of_real_robots_is_found(shared, tmp_path, capsys):
    folder = shared / "real"
    balls = json.loads((folder / "balls.json").read_text())
    cameras = defaultdict(dict)
    for lens in sorted((folder / "images").glob("lens*.yaml")):
        name = f"image{lens.stem.removeprefix('lens')}.jpg"
        cameras[lens.read_text()][name] = balls.get(name, [])
    assert len(cameras) == 6
    for text, pictures in cameras.items():
        lens, outlines, output = tmp_path / "file.yaml", tmp_path / "balls.json", tmp_path / "lens.yaml"
        lens.write_text(text)
        outlines.write_text(json.dumps(pictures))
        run(capsys, "pose", "--lens", lens, "--balls", outlines, "--size", "608x800", "-o", output)
        found, true = read_lens_file(output).orientation, read_lens_file(lens).orientation
        assert found.height == pytest.approx(true.height, rel=0.05)
