"""Random damage to annotation files."""

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.boxes.read import read_boxes

from .written import coco_table, voc_text, write_image, write_yolo

BALL = ("ball", 20.0, 30.0, 40.0, 50.0)
GOAL = ("goal", 100.0, 10.0, 110.0, 90.0)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("a.txt", "0 0.5 0.5 0.1 0.1\n1 0.2 0.25 1e-1 0.125\n"),
        ("a.xml", voc_text("a.jpg", [BALL, GOAL])),
        ("all.json", json.dumps(coco_table({"a": [BALL, GOAL]}))),
        ("data.yaml", "names: [ball, goal]\nnc: 2\n"),
        ("classes.txt", "ball\ngoal\n"),
    ],
)
@given(data=st.data())
def test_no_damage_to_a_text_raises_another_error(file, text, data):
    content = bytearray(text.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at, length = data.draw(st.integers(0, len(content))), data.draw(st.integers(0, 12))
        content[at : at + length] = data.draw(st.binary(max_size=4) | st.sampled_from([b"9" * 400, b"[[", b"\0", b"-"]))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_yolo(folder, {"b": [BALL]})
        write_image(folder / "a.jpg")
        (folder / file).write_bytes(content)
        if file in ("data.yaml", "classes.txt"):
            (folder / "a.txt").write_text("0 0.5 0.5 0.1 0.1\n")
        try:
            found = read_boxes(folder, {".xml": "voc", ".json": "coco"}.get(Path(file).suffix, "yolo"))
        except InputError as error:
            faults = (str(error),)
        else:
            faults = found.faults
            assert {each.image.name for each in found.pictures} <= {"a.jpg", "b.jpg"}
        assert all("\n" not in line for line in faults)
