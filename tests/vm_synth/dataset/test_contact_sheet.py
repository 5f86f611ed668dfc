"""Contact sheets: whether they show the right pictures, and the ball's outline where the ball is."""

import json
import shutil

import cv2
import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.shapes import Sphere
from vm_synth.cli import main, parsers
from vm_synth.dataset.contact_sheet import OUTLINE, captions, cell, read_labeled, sheet, tinted
from vm_synth.dataset.files import PARTS, file_of, read_truth
from vm_workstation.contact_sheet import scaled_pixels
from vm_workstation.outlines import polygon_area, shape_outline

from ..sets import SIZE, scene_of, write_set

COUNT = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_set(tmp_path_factory.mktemp("sheets") / "balls", range(COUNT))


def outline_of(scene):
    """The outline of a scene's ball."""
    shape = Sphere(scene.ball.radius)
    return shape_outline(scene.lens, scene.orientation, shape, scene.ball.center, SIZE)


def with_ball(least=4.0):
    """Numbers of the set's pictures that show a whole ball of at least this radius [px]."""
    found = []
    for index in range(COUNT):
        scene = scene_of(index)
        if scene.ball is not None:
            pixels = outline_of(scene)
            inside = np.isfinite(pixels).all() and (pixels > 0).all() and (pixels < np.array(SIZE) - 1).all()
            if inside and polygon_area(pixels) > np.pi * least**2:
                found.append(index)
    assert found
    return found


def test_the_outline_from_the_files_is_the_scene_s(folder):
    for index in range(COUNT):
        scene, shown = scene_of(index), read_labeled(folder, index)
        assert (scene.ball is None) == (not shown.outlines)
        if scene.ball is not None:
            straight = outline_of(scene)
            np.testing.assert_allclose(shown.outlines[0], straight, atol=1e-9)


def test_rays_through_the_outline_touch_the_ball(folder):
    for index in with_ball():
        lens, ball = read_lens_file(file_of(folder, "lens", index)), read_truth(folder, index)["ball"]
        rays = lens.lens.unproject(read_labeled(folder, index).outlines[0], SIZE) @ lens.orientation.rotation.T
        toward = np.array(ball["center"]) - [0.0, 0.0, lens.orientation.height]
        off = np.linalg.norm(np.cross(rays, toward), axis=1)
        np.testing.assert_allclose(off, ball["radius"], rtol=1e-6)


@pytest.mark.parametrize("width", [48, 96, 240])
def test_a_cell_draws_the_outline_on_the_ball_s_rim(folder, width):
    index = with_ball()[0]
    shown = read_labeled(folder, index)
    made = cell(shown, width)
    height = round(SIZE[1] * width / SIZE[0])
    plain, lower = made[:height], made[height + 1 : 2 * height + 1]
    assert made.shape[1] == width
    assert not (plain == OUTLINE[::-1]).all(axis=-1).any()
    difference = np.abs(lower.astype(int) - OUTLINE[::-1]).sum(axis=-1)
    rim = np.rint(scaled_pixels(shown.outlines[0], (0.0, 0.0), width / SIZE[0])).astype(int)
    near = [difference[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].min() for x, y in rim]
    assert np.mean(np.array(near) < 200) > 0.95


def test_tints_leave_the_environment_and_unlabeled_pixels_alone(folder):
    shown = read_labeled(folder, 0)
    made = tinted(shown.image, shown.mask)
    bare = (shown.mask[..., 3] == 0) | ~shown.mask[..., :3].any(axis=-1)
    assert (made[bare] == shown.image[bare]).all()
    assert (made[~bare] != shown.image[~bare]).any(axis=-1).mean() > 0.95


def test_captions_say_which_picture_and_which_ball(folder):
    index = with_ball()[0]
    first, second = captions(read_labeled(folder, index))
    ball = read_truth(folder, index)["ball"]
    assert first == f"{index}  room"
    assert second.startswith(f"{ball['distance']:.2f} m, radius {ball['pixel_radius']:.1f} px")


def test_a_sheet_too_large_for_a_file_is_refused():
    tall = np.zeros((2000, 10, 3), dtype=np.uint8)
    with pytest.raises(InputError, match="too large"):
        sheet([tall] * 40, 1, "")


def test_preview_writes_beside_the_pictures(folder, capsys):
    assert main(["preview", str(folder), "--count", "4"]) == 0
    assert capsys.readouterr().out == f"{folder / 'preview.jpg'}: 4 pictures\n"
    made = cv2.imread(str(folder / "preview.jpg"))
    assert made.shape[1] == 6 + 4 * (320 + 6)
    assert not list(folder.glob("*.part"))
    (folder / "preview.jpg").unlink()


def test_preview_skips_what_is_broken(tmp_path, capsys):
    folder = write_set(tmp_path / "set", range(3))
    file_of(folder, "image", 1).write_bytes(b"")
    assert main(["preview", str(folder), "--output", str(tmp_path / "sheet.png")]) == 0
    said = capsys.readouterr()
    assert "2 pictures" in said.out
    assert said.err.startswith("vm-synth: skipped ")
    assert "image0000001.jpg" in said.err
    assert cv2.imread(str(tmp_path / "sheet.png")) is not None


@pytest.mark.parametrize(
    "damage",
    [
        lambda truth: truth.pop("ball"),
        lambda truth: truth.update(ball={"center": [1.0], "radius": 0.1}),
        lambda truth: truth.update(ball=3),
        lambda truth: truth.update(ball={"center": [1.0, 0.0, 0.1], "radius": None}),
        lambda truth: truth.pop("map"),
    ],
)
def test_wrong_truth_is_named(folder, tmp_path, damage):
    for part in PARTS:
        shutil.copy(file_of(folder, part, 0), tmp_path)
    folder = tmp_path
    truth = read_truth(folder, 0)
    damage(truth)
    file_of(folder, "scene", 0).write_text(json.dumps(truth))
    with pytest.raises(InputError, match=r"scene0000000\.json is damaged"):
        read_labeled(folder, 0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nowhere"], "there is no folder nowhere"),
        (["{set}", "--output", "sheet.gif"], "must be a .jpg or a .png"),
        (["{set}", "--output", "no/such/sheet.jpg"], "there is no folder"),
        (["{set}", "--first", "900"], "has no complete pictures from number 900 on; run vm-synth check"),
    ],
)
def test_wrong_commands_are_one_line(folder, capsys, arguments, text):
    assert main(["preview", *(each.format(set=folder) for each in arguments)]) == 1
    said = capsys.readouterr().err
    assert text in said
    assert said.startswith("vm-synth: ")
    assert said.count("\n") == 1


@pytest.mark.parametrize("arguments", [["--count", "0"], ["--count", "x"], ["--first", "1", "--seed", "2"]])
def test_wrong_options_are_refused(folder, arguments):
    with pytest.raises(SystemExit) as found:
        main(["preview", str(folder), *arguments])
    assert found.value.code == 2


def test_every_option_has_help():
    assert list(parsers()) == ["vm-synth", "vm-synth preview", "vm-synth check", "vm-synth config"]
    for each in parsers().values():
        assert each.description
        assert all(action.help for action in each._actions)
