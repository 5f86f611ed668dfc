"""Boxes that a person draws: what is stored, what they replace, what a click gives, and what is written."""

import json
import math
import shutil

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drawn_scenes import FOLDER, IMAGES, TRUTH
from tests.programs import run_program
from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError, VisualMeshError
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_embedded.output.box_files import edges, overlap
from vm_label.answers import AnswerFile, read_answers
from vm_label.box_folder import read_box_folder, with_drawn
from vm_label.crops import Crop, checked_shares, replaced
from vm_label.sizing import box_at

from .made import SIZE, answer_lines, make_folder, run, serving
from .test_cli import post, request

IDS = [f"{number:016x}" for number in range(5)]


def state_of(address):
    return json.loads(request(address, "GET", "/state")[1])


def drawing(state, at=0, /, **changes):
    """The body of an answer with a drawn box."""
    drawn = {"picture": state["pictures"][at]["id"], "class": "ball", "box": [0.7, 0.7, 0.1, 0.1]}
    body = {"session": state["session"], "crop": IDS[0], "answer": "yes"}
    return (
        body
        | {"drawn": drawn | {k: v for k, v in changes.items() if k in drawn}}
        | {k: v for k, v in changes.items() if k in body}
    )


def send(address, body, status=200):
    given, reply = post(address, json.dumps(body))
    assert given == status, reply
    return json.loads(reply) if status == 200 else reply.decode()


def empty_folder(folder, count=3):
    """Images in which nothing was found."""
    make_folder(folder, count, near=False)
    (folder / "candidates.jsonl").unlink()
    for label in folder.glob("image*.txt"):
        label.write_text("")
    return folder


def test_a_missed_ball_is_drawn_saved_and_written_and_a_picture_without_one_is_background(tmp_path):
    folder = empty_folder(tmp_path / "boxes", 4)
    with serving(folder) as (_, address):
        state = state_of(address)
        assert state["crops"] == []
        assert state["classes"] == ["ball"]
        send(address, drawing(state, 0))
        send(address, drawing(state, 1, crop=IDS[1], box=[0.3, 0.5, 0.2, 0.2]))
        send(address, drawing(state, 1, crop=IDS[1], box=[0.3, 0.5, 0.2, 0.2], answer=None))  # undone
        for place, answer in ((1, "no"), (2, "skip")):
            body = {"session": state["session"], "crop": state["pictures"][place]["id"], "answer": answer}
            send(address, body)
        assert post(address, json.dumps(body | {"answer": "yes"}))[0] == 400
        (crop,) = state_of(address)["crops"]
        assert (crop["id"], crop["drawn"], crop["answer"]) == (IDS[0], True, "yes")
    with serving(folder) as (_, address):  # the process was killed; everything is on disk
        state = state_of(address)
        assert [crop["id"] for crop in state["crops"]] == [IDS[0]]
        assert [picture["answer"] for picture in state["pictures"]] == [None, "no", "skip", None]
    done = run(folder, "--write", tmp_path / "out")
    assert "2 images, 1 of them background; boxes: 1 ball" in done.stdout
    assert "1 image with skipped crops" in done.stdout
    assert "1 image without any crop or answer" in done.stdout
    assert (tmp_path / "out" / "image0000.txt").read_text() == "0 0.700000 0.700000 0.100000 0.100000\n"
    assert (tmp_path / "out" / "image0001.txt").read_text() == ""
    assert len(read_box_folder(tmp_path / "out").crops) == 1


def test_a_drawn_box_replaces_the_bad_one_and_comes_back_with_undo(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1, near=False)
    with serving(folder) as (_, address):
        state = state_of(address)
        (bad,) = state["crops"]
        better = [bad["box"][0] + 0.01, *bad["box"][1:]]
        assert send(address, drawing(state, box=better))["replaced"] == [bad["id"]]
        assert {each["id"]: each["replaced"] for each in state_of(address)["crops"]} == {bad["id"]: True, IDS[0]: False}
        run(folder, "--write", tmp_path / "better")
        assert send(address, drawing(state, box=better, answer=None))["replaced"] == []
        assert [each["id"] for each in state_of(address)["crops"]] == [bad["id"]]
    assert (tmp_path / "better" / "image0000.txt").read_text().split()[1] == f"{better[0]:.6f}"
    assert "judge them on the page first" in run(folder, "--write", tmp_path / "none", code=1).stderr


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    folder = make_folder(tmp_path_factory.mktemp("served") / "boxes", 2, near=False)
    with serving(folder) as (_, address):
        yield folder, address


@pytest.mark.parametrize(
    "change",
    [
        {"box": [0.99, 0.5, 0.1, 0.1]},
        {"box": [0.5, -0.2, 0.1, 0.1]},
        {"box": [0.5, 0.5, 0.0, 0.1]},
        {"box": [0.5, 0.5, -0.1, 0.1]},
        {"box": [0.5, 0.5, math.nan, 0.1]},
        {"box": [0.5, 0.5, 1e999, 0.1]},
        {"box": [0.5, 0.5, 1.5 / SIZE[0], 0.1]},
        {"box": [0.5, 0.5, 0.1]},
        {"box": [[0.5, 0.5, 0.1, 0.1]]},
        {"box": ["0.5", "0.5", "0.1", {}]},
        {"box": None},
        {"class": "robot"},
        {"class": ["ball"]},
        {"picture": "0" * 16},
        {"picture": None},
        {"picture": []},
        {"crop": "../../classes.txt"},
        {"crop": ""},
    ],
    ids=str,
)
def test_the_server_refuses_an_unusable_drawn_box_and_stores_nothing(served, change):
    folder, address = served
    reason = send(address, drawing(state_of(address), **change), status=422)
    assert len(reason) > 20
    assert len(state_of(address)["crops"]) == 2
    assert (folder / "answers.jsonl").read_text() == ""


def test_an_id_stays_with_its_box(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1, near=False)
    with serving(folder) as (_, address):
        state = state_of(address)
        send(address, drawing(state))
        send(address, drawing(state))  # sent again, because the reply was lost
        send(address, drawing(state, box=[0.2, 0.2, 0.1, 0.1]), status=422)
        send(address, drawing(state, crop=state["crops"][0]["id"]), status=422)
        send(address, drawing(state, crop=state["pictures"][0]["id"]), status=422)
        assert len(state_of(address)["crops"]) == 2
    assert [line["box"] for line in answer_lines(folder)] == [[0.7, 0.7, 0.1, 0.1]] * 2


@pytest.mark.parametrize(
    "change", [{"box": [2, 0, 1, 1]}, {"box": "x"}, {"class": ""}, {"class": "a" * 200}, {"box": [1e400] * 4}], ids=str
)
def test_a_bad_line_of_a_drawn_box_is_named_and_the_others_count(tmp_path, change):
    folder = make_folder(tmp_path, 1, near=False)
    crop = Crop("image0000.jpg", "ball", (0.7, 0.7, 0.1, 0.1), None, IDS[0])
    with AnswerFile(folder) as file:
        file.append(crop, "yes")
    (line,) = answer_lines(folder)
    with (folder / "answers.jsonl").open("a") as file:
        file.write(json.dumps(line | {"crop": IDS[1]} | change) + "\n")
    answers, drawn, (fault,) = read_answers(folder)
    assert (answers, drawn) == ({IDS[0]: "yes"}, [crop])
    assert "line 2" in fault


def test_boxes_of_images_that_are_gone_are_named_and_new_classes_are_kept(tmp_path):
    folder = make_folder(tmp_path / "boxes", 2, near=False)
    with AnswerFile(folder) as file:
        for number, (image, name) in enumerate([("image0000.jpg", "robot"), ("image0001.jpg", "ball")]):
            file.append(Crop(image, name, (0.7, 0.7, 0.1, 0.1), None, IDS[number]), "yes")
        file.append(read_box_folder(folder).crops[0], "yes")
    (folder / "image0001.jpg").unlink()
    done = run(folder, "--write", tmp_path / "out")
    assert "image0001.jpg" in done.stderr
    assert (tmp_path / "out" / "classes.txt").read_text() == "ball\nrobot\n"
    assert [line[0] for line in (tmp_path / "out" / "image0000.txt").read_text().splitlines()] == ["0", "1"]
    judged = with_drawn(read_box_folder(folder, ["ball"]), read_answers(folder)[1], ["ball"])
    assert [crop.class_name for crop in judged.crops] == ["ball"]


SHARES = st.tuples(*[st.sampled_from([0.3, 0.32, 0.5, 0.7])] * 2, *[st.sampled_from([0.1, 0.2])] * 2)
CROPS = st.lists(
    st.builds(Crop, st.sampled_from(["a.jpg", "b.jpg"]), st.sampled_from(["ball", "robot"]), SHARES, st.none()),
    max_size=5,
)
DRAWN = st.lists(st.builds(Crop, st.just("a.jpg"), st.just("ball"), SHARES, st.none()), max_size=len(IDS))
ANSWERS = st.sampled_from(["yes", "no", "skip", None])


@given(CROPS, DRAWN, st.data())
def test_of_accepted_boxes_none_lies_on_a_drawn_one_of_its_class(found, drawn, data):
    drawn = [Crop(each.image, each.class_name, each.shares, None, id) for each, id in zip(drawn, IDS, strict=False)]
    crops = [*dict.fromkeys(found), *drawn]
    answers = {crop.id: answer for crop in data.draw(st.permutations(crops)) if (answer := data.draw(ANSWERS))}
    gone = replaced(crops, answers)
    left = [crop for crop in crops if crop.id not in gone and answers.get(crop.id) == "yes"]
    for one in left:
        for other in (each for each in left if each.drawn and each is not one):
            same = (one.image, one.class_name) == (other.image, other.class_name)
            assert not same or overlap(edges(one.shares), edges(other.shares)) <= 0.5
    newest = next((id for id in reversed(answers) if answers[id] == "yes" and id in IDS), None)
    assert newest not in gone
    if newest is None:
        assert not gone


@given(st.lists(st.floats() | st.none() | st.text(max_size=3), max_size=5))
def test_a_checked_box_is_in_the_image(values):
    try:
        x, y, width, height = checked_shares(values)
    except InputError:
        return
    assert min(width, height) >= 0.0
    assert -3e-6 <= min(edges((x, y, width, height))) <= max(edges((x, y, width, height))) <= 1.0 + 3e-6


def test_a_click_on_a_ball_gives_the_box_that_the_detector_gives(tmp_path):
    run_program("vm-detect", "--camera", FOLDER, "--save-boxes", tmp_path)
    truth = json.loads(TRUTH.read_text())
    for image in IMAGES:
        height, width = read_image(image).shape[:2]
        x, y = truth[image.name]["center"]
        box = box_at(tmp_path / image.name, (width, height), ((x + 0.5) / width, (y + 0.5) / height))
        found = [crop.shares for crop in read_box_folder(tmp_path).crops if crop.image == image.name]
        assert max(overlap(edges(box), edges(each)) for each in found) > 0.7


def ball_folder(folder, object_file='shape = "sphere"\nradius = 0.1\n', pose=True):
    """An image with the lens of a camera that looks forward, 1 m over the plane."""
    lens = Rectilinear.from_horizontal_fov(math.radians(90), (640, 480))
    folder.mkdir(exist_ok=True)
    cv2.imwrite(str(folder / "image0.png"), np.zeros((480, 640, 3), np.uint8))
    pose = Orientation.from_roll_pitch(1.0, 0.0, math.radians(20)) if pose else None
    (folder / "lens0.yaml").write_text(format_lens_file(lens, pose))
    if object_file:
        (folder / "object.toml").write_text(object_file)
    return folder / "image0.png"


def test_the_size_of_a_clicked_ball_follows_from_its_distance(tmp_path):
    image = ball_folder(tmp_path)
    x, y, width, height = box_at(image, (640, 480), (0.5, 0.5))
    distance = 0.9 / math.sin(math.radians(20))  # along the axis, down to the height of the ball's center
    radius = 320 * math.tan(math.asin(0.1 / distance))
    assert (x, y) == pytest.approx((0.5, 0.5), abs=1e-3)
    assert (width * 640, height * 480) == pytest.approx((2 * radius, 2 * radius), rel=0.02)
    assert box_at(image, (640, 480), (0.5, 0.9))[2] > 1.5 * width
    cut = box_at(image, (640, 480), (0.999, 0.9))
    assert edges(cut)[2] == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("object_file", "pose", "point", "part"),
    [
        ("", True, (0.5, 0.5), "object.toml"),
        ("radius = 0.1", False, (0.5, 0.5), "Hoc"),
        ("radius = 0.1", True, (0.5, 0.01), "horizon"),
        ("radius = 0.1", True, (0.5, 1.5), "1.5"),
        ("radius = 0.1", True, (math.nan, 0.5), "nan"),
        ("radius = 0.003", True, (0.5, 0.4), "too small"),
        ("radius = 3.0", True, (0.5, 0.5), "below the center"),
        ("radius = -1", True, (0.5, 0.5), "object.toml"),
        ("radius = '1'", True, (0.5, 0.5), "object.toml"),
        ("radius = 0.1\nshape = 'cube'", True, (0.5, 0.5), "did you mean|allowed"),
        ("radius = 0.1\nheihgt = 1", True, (0.5, 0.5), "height"),
        ("shape = 'cylinder'\nradius = 0.1", True, (0.5, 0.5), "height"),
        ("[", True, (0.5, 0.5), "object.toml"),
    ],
    ids=str,
)
def test_a_click_without_what_it_needs_says_what_is_missing(tmp_path, object_file, pose, point, part):
    image = ball_folder(tmp_path, object_file, pose)
    with pytest.raises(VisualMeshError, match=part):
        box_at(image, (640, 480), point)


def test_the_server_answers_a_click_with_a_box_or_a_reason(tmp_path):
    image = ball_folder(tmp_path)
    (tmp_path / "classes.txt").write_text("ball\n")
    with serving(tmp_path) as (_, address):
        id = state_of(address)["pictures"][0]["id"]
        status, content = request(address, "GET", f"/box/{id}/0.5/0.5")
        assert status == 200
        assert json.loads(content)["box"] == list(box_at(image, (640, 480), (0.5, 0.5)))
        for path in (f"{id}/0.5/0", f"{id}/x/0.5", f"{id}/nan/0.5", f"{id}/1e999/0.5"):
            assert request(address, "GET", f"/box/{path}")[0] == 422
        for path in (f"{id}/0.5", f"{id}/0.5/0.5/0.5", "0/0.5/0.5", ""):
            assert request(address, "GET", f"/box/{path}")[0] == 404
        (tmp_path / "lens0.yaml").unlink()
        status, reason = request(address, "GET", f"/box/{id}/0.5/0.5")
        assert (status, b"lens file" in reason) == (422, True)
        shutil.rmtree(tmp_path)
