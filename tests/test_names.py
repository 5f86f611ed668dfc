"""Names of classes: bad ones are refused wherever they come in, and good ones are the same in all outputs."""

import json
from html import unescape

import numpy as np
import pytest
from hypothesis import given

from tests.looks import look_contract
from tests.manifests import ball_manifest
from tests.vm_embedded.borders.test_text import BAD_NAMES, GOOD_NAMES
from tests.vm_embedded.strategies import attempt, class_names
from tests.vm_train.boxes.written import write_coco, write_image, write_voc
from vm_embedded.borders.text import MOST_REMARK, name_fault
from vm_embedded.config.sections import read_sections
from vm_embedded.config.toml_reader import parse_toml
from vm_embedded.errors import InputError, ModelError
from vm_embedded.network.look_contract import LookContract
from vm_embedded.network.manifest import MOST_CLASSES, Manifest
from vm_embedded.output.binary_form import HEADER, to_binary
from vm_embedded.output.box_files import CANDIDATES, CLASSES
from vm_export.reference import named_class
from vm_label.box_folder import read_box_folder
from vm_label.training_boxes import write_training_boxes
from vm_synth.dataset.training_file import training_text
from vm_synth.scene.configuration import SceneConfiguration
from vm_synth.scene.own_object import ObjectRanges
from vm_train.boxes.read import read_boxes
from vm_train.cli.box_options import parse_names
from vm_train.data.class_table import ClassTable
from vm_train.evaluation.html_page import html_table
from vm_train.learning.configuration import TrainConfiguration
from vm_train.truth.objects import read_scene
from vm_workstation.plots import new_figure, save_figure

BALL = ball_manifest("ball", "other", mesh="octaves", peaks=("ball",), look=look_contract())
BOX = (20.0, 30.0, 40.0, 50.0)

bad_names = pytest.mark.parametrize("name", BAD_NAMES, ids=lambda name: ascii(name)[:20])
good_names = pytest.mark.parametrize("name", GOOD_NAMES, ids=lambda name: ascii(name)[:20])
INSIDE = [name for name in BAD_NAMES if name.strip() == name != "" and not name.isspace() and len(name) < 1000]
"""Bad names that stay bad without the white space at their ends, and are short enough for many files."""


def manifest_json(name, place):
    """BALL with another name in a place."""
    data = json.loads(BALL.as_json())
    if place == "class":
        data["classes"][1]["name"] = name
    elif place == "look":
        data["look"]["classes"][0]["name"] = name
    else:
        part = data["look"] if place == "look's provenance" else data
        part["provenance"] = {name: "x"}
    return json.dumps(data)


@bad_names
@pytest.mark.parametrize("place", ["class", "look", "provenance", "look's provenance"])
def test_a_bad_name_in_a_manifest_is_refused_in_a_line(name, place):
    with pytest.raises(ModelError) as refused:
        Manifest.from_json(manifest_json(name, place))
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 25_000
    if place == "look":
        data = json.loads(manifest_json(name, place))["look"]
        with pytest.raises(ModelError):
            LookContract.from_dict(data)


@pytest.mark.parametrize(
    "text", ["a\nb", "\x1b[2J", "\ud800", "x" * (MOST_REMARK + 1)], ids=lambda text: ascii(text)[:9]
)
@pytest.mark.parametrize("of_look", [False, True])
def test_a_bad_text_in_a_provenance_is_refused(text, of_look):
    data = json.loads(BALL.as_json())
    (data["look"] if of_look else data)["provenance"] = {"made_from": text}
    with pytest.raises(ModelError, match="made_from in the provenance"):
        Manifest.from_json(json.dumps(data))


def test_a_network_has_a_limited_number_of_classes():
    def table(count):
        return {f"c{number}": {"kind": "area", "colors": [[number, 0, 0]]} for number in range(count)}

    assert len(ClassTable.from_table(table(MOST_CLASSES)).outputs) == MOST_CLASSES
    ball_manifest(*(f"c{number}" for number in range(MOST_CLASSES)))
    with pytest.raises(InputError, match=f"at most {MOST_CLASSES}"):
        ClassTable.from_table(table(MOST_CLASSES + 1))
    with pytest.raises(ModelError, match=f"1 to {MOST_CLASSES}"):
        ball_manifest(*(f"c{number}" for number in range(MOST_CLASSES + 1)))


def test_the_names_of_all_classes_fit_into_the_binary_form():
    names = [("\U0001f3c0" * 97 + f"{number:03d}") for number in range(MOST_CLASSES)]
    message = {"type": "frame", "state": "ok", "t": 1.0, "wall": 2.0, "detections": []}
    content = to_binary(message | {"field": {"posts": [{"class": name, **POST} for name in names]}})
    size = np.frombuffer(content, HEADER, 1)["text"][0]
    assert content[len(content) - size :].decode().split("\n") == names


POST = {"confidence": 1, "position": (0, 0), "distance": 1, "bearing": (1, 0, 0), "pixel": (1, 1), "width": 1}


@bad_names
def test_a_bad_name_in_train_toml_is_refused(name):
    colors = {"kind": "area", "colors": [[1, 2, 3]]}
    with pytest.raises(InputError):
        ClassTable.from_table({name: colors, "other": colors | {"colors": [[4, 5, 6]]}})


@given(class_names)
def test_any_name_in_train_toml_is_written_and_read_again(name):
    table = {name: {"kind": "object", "colors": [[1, 2, 3]]}, f"_{name[:90]}": {"kind": "area", "colors": [[4, 5, 6]]}}
    classes = ClassTable.from_table(table)
    assert ClassTable.from_table(parse_toml(classes.to_commented_toml())["classes"]) == classes


@pytest.mark.parametrize("name", ["cup", "Tasse", "コップ", "größe_2"])
def test_the_train_toml_of_an_object_with_any_name_is_read_by_vm_train(name, tmp_path):
    path = tmp_path / "train.toml"
    path.write_text(training_text(SceneConfiguration(object=ObjectRanges(solid="cylinder", name=name))))
    assert next(iter(read_sections(TrainConfiguration, path).classes.kinds)) == name


def test_an_object_with_a_long_name_is_refused():
    with pytest.raises(InputError, match="name must be one word"):
        ObjectRanges(solid="cylinder", name="x" * 101)


@bad_names
def test_a_bad_name_in_an_option_is_refused(name):
    with pytest.raises(InputError):
        named_class(name, "area")
    if name in INSIDE and name.split() == [name]:  # white space becomes a blank
        with pytest.raises(InputError):
            parse_names([f"0={name}"])


def folders(tmp_path, name):
    """A folder of each format in which this is the name of a class, as far as the format can hold it."""
    for kind in ("coco", "voc", "classes", "yaml", "candidates"):
        (tmp_path / kind).mkdir()
    picture = {"a": [(name, *BOX)]}
    write_coco(tmp_path / "coco", picture)
    yield tmp_path / "coco"
    is_text = name.encode("utf-8", "ignore").decode() == name
    if is_text and not any(each < " " for each in name):
        write_voc(tmp_path / "voc", picture)
        yield tmp_path / "voc"
        for kind, file, text in (
            ("classes", CLASSES, f"first\n{name}\n"),
            ("yaml", "data.yaml", f"names:\n  0: first\n  1: {json.dumps(name, ensure_ascii=False)}\n"),
        ):
            write_image(tmp_path / kind / "a.png")
            (tmp_path / kind / "a.txt").write_text("1 0.5 0.5 0.2 0.2\n")
            (tmp_path / kind / file).write_text(text)
            yield tmp_path / kind


@pytest.mark.parametrize("name", INSIDE, ids=lambda name: ascii(name)[:20])
def test_a_bad_name_in_a_folder_of_boxes_is_refused_or_cleaned(name, tmp_path):
    """White space of any kind is a blank, as it always was."""
    for folder in folders(tmp_path, name):
        found = attempt(InputError, read_boxes, folder)
        if isinstance(found, InputError):
            assert str(found).isprintable()
        else:
            assert set(found.names) <= {" ".join(name.split())}
            assert not any(map(name_fault, found.names))
            assert found.names or found.findings


@good_names
def test_a_good_name_in_a_folder_of_boxes_is_read(name, tmp_path):
    if "&" not in name:  # which XML and YAML write in another way
        for folder in folders(tmp_path, name):
            assert read_boxes(folder).names == (name,), folder


def test_another_line_end_in_a_table_of_names_does_not_shift_the_numbers(tmp_path):
    (folder,) = (each for each in folders(tmp_path, "a\u2028b") if each.name == "classes")
    (folder / CLASSES).write_text("goal\u2028post\nball\n")
    assert read_boxes(folder).names == ("ball",)


def labeled(folder, name):
    """A folder for vm-label with a near miss of a class."""
    folder.mkdir()
    write_image(folder / "a.png")
    near = {"image": "a.png", "class": name, "box": [0.5, 0.5, 0.2, 0.2], "confidence": 0.4, "found": False}
    (folder / CANDIDATES).write_text(json.dumps(near) + "\n")
    return folder


@pytest.mark.parametrize("name", INSIDE, ids=lambda name: ascii(name)[:20])
def test_a_class_of_vm_label_is_one_line_of_its_table(name, tmp_path):
    folder = read_box_folder(labeled(tmp_path / "boxes", name))
    assert folder.classes or folder.problems
    write_training_boxes(folder, {crop.id: "yes" for crop in folder.crops}, tmp_path / "out", True)
    for table in (tmp_path / "out").rglob(CLASSES):
        assert tuple(table.read_text().split("\n")[:-1]) == folder.classes


@pytest.mark.parametrize("name", ["\ud800", "a\nb\x1b[2J", "x" * 200], ids=lambda name: ascii(name)[:9])
def test_a_bad_class_in_a_scene_is_refused(name, tmp_path):
    path = tmp_path / "scene0.json"
    path.write_text(json.dumps({"object": {"name": name, "radius": 0.1}, "objects": []}))
    with pytest.raises(InputError, match="scene0"):
        read_scene(path)


@given(class_names)
def test_a_name_in_a_report_is_text(name):
    page = html_table(["class"], [[name]])
    assert f"<td>{name}</td>" in unescape(page)
    assert page.count("<") == len(["table", "tr", "th", "/th", "/tr", "tr", "td", "/td", "/tr", "/table"])


@pytest.mark.parametrize("name", ["$", r"$\frac{", r"$\nosuch$ and $x$", "a$b$c"])
def test_a_figure_shows_dollar_signs_in_names(name, tmp_path):
    pytest.importorskip("matplotlib")
    figure = new_figure(3.0, 2.0)
    axes = figure.subplots()
    axes.semilogx([1.0, 10.0], [1.0, 2.0], label=name)
    axes.set_title(name)
    axes.set_yticks([1.0], labels=[name])
    axes.legend()
    figure.suptitle(name)
    path = tmp_path / "figure.svg"
    save_figure(figure, path)
    assert path.stat().st_size > 1000
