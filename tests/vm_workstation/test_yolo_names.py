"""Tables of class names beside label files in YOLO format."""

from pathlib import Path

import pytest

from vm_embedded.errors import InputError
from vm_workstation.yolo_names import NameTables


def names_of(folder, **tables):
    """The names after writing tables to a folder; in their names, the last _ is a dot."""
    for name, text in tables.items():
        (folder / ".".join(name.rsplit("_", 1))).write_text(text)
    return NameTables(folder).of(folder)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("classes_txt", "ball\ngoal post\n"),
        ("classes_txt", "\ufeffball\r\n goal  post \r\n\r\n"),
        ("obj_names", "ball\ngoal post"),
        ("data_yaml", "train: images\nnc: 2\nnames: [ball, 'goal post']\n"),
        ("data_yml", "names: [\n  'ball',\n  'goal post',\n]\nnc: 2\n"),
        ("data_yaml", "train: a\nnames: [\n'ball',\n# a [comment\n'goal post'\n]\nnc: 2\ndownload: |\n  a: [x, {\n"),
        ("data_yaml", 'names: {\n0: ball,\n"1": goal post\n} # }\nnc: 2\n'),
        ("data_yaml", "names:\n  [\nball, goal post ]\nnc: 2\n"),
        ("_darknet_labels", "ball\ngoal post\n"),
        ("data_yaml", "names:\n- ball\n# posts only\n\n- goal post\nnc: 2\n"),
        ("dataset_yaml", "path: ../set # root\n\nnames:\n  0: ball\n  1: goal post\n\ndownload: |\n  a: [script, {\n"),
        ("dataset_yml", "names: {0: ball, 1: goal post}"),
    ],
)
def test_tables_of_all_kinds(name, text, tmp_path):
    assert names_of(tmp_path, **{name: text}) == ("ball", "goal post")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("data_yaml", "names: {0: ball, 2: goal}", "names must have the numbers from 0 to 1"),
        ("data_yaml", "nc: 2", "lacks names, the list of class names"),
        ("data_yaml", "names: ball", "lacks names, the list of class names"),
        ("data_yaml", "names:[ball, goal]", "names lacks a space after its colon"),
        ("data_yaml", "names: [", "line 1: bracket is not closed"),
        ("data_yaml", "names: []", "must give a name for each class number"),
        ("data_yaml", "names:\n  0:\n  1: ball", "must give a name for each class number"),
        ("classes_txt", "", "must give a name for each class number"),
        ("classes_txt", "ball\n\ngoal\n", "must give a name for each class number"),
        ("classes_txt", "ball\ngoal\nball\n", "has a name twice: ball, goal, ball"),
    ],
)
def test_an_unusable_table_is_named(name, text, said, tmp_path):
    with pytest.raises(InputError) as caught:
        names_of(tmp_path, **{name: text})
    assert str(caught.value).startswith(f"{tmp_path / name.replace('_', '.')}: ")
    assert said in str(caught.value)


def test_a_table_that_is_not_text_is_named(tmp_path):
    (tmp_path / "obj.names").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"can't read .*obj\.names: it is not UTF-8 text"):
        names_of(tmp_path)


def test_tables_in_one_folder_must_agree(tmp_path):
    assert names_of(tmp_path, classes_txt="ball\ngoal\n", data_yaml="names: [ball, goal]") == ("ball", "goal")
    with pytest.raises(InputError, match=r"classes\.txt and .*obj\.names name the classes differently"):
        names_of(tmp_path, obj_names="goal\nball\n")


def test_the_nearest_table_counts(tmp_path):
    top = tmp_path / "sets" / "mine"
    labels = top / "labels" / "day1"
    labels.mkdir(parents=True)
    assert NameTables(top).of(labels) == ()
    for folder, expected in ((tmp_path, ()), (top.parent, ("sets",)), (top, ("mine",)), (labels, ("day1",))):
        (folder / "classes.txt").write_text(f"{folder.name}\n")
        tables = NameTables(top)
        assert tables.of(labels) == expected
        assert tables.of(labels) == expected
    assert tables.of(top / "labels") == ("mine",)


def test_labels_beside_the_given_folder_of_images_have_the_table_above_both(tmp_path, monkeypatch):
    (tmp_path / "data.yaml").write_text("names: [ball]")
    (tmp_path / "labels" / "day1").mkdir(parents=True)
    (tmp_path / "images").mkdir()
    assert NameTables(tmp_path / "images").of(tmp_path / "labels" / "day1") == ("ball",)
    monkeypatch.chdir(tmp_path / "images")
    assert NameTables(Path()).of(Path()) == ("ball",)
    assert NameTables(Path("/")).of(Path("/")) == ()
