"""What OpenCV gets of names and texts: the file of exactly this name, text that it can draw, or an error."""

import ast
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.rooms import CHECKOUT
from vm_embedded.borders.opencv_text import draw_text, open_capture, text_size
from vm_embedded.cameras.image_files import open_source
from vm_embedded.detection.labels import Labels
from vm_embedded.errors import InputError
from vm_embedded.files import library_path
from vm_embedded.output.video_file import VideoFile
from vm_workstation.contact_sheet import write_text

NAMES = {
    *("imread", "imreadmulti", "imwrite", "imwritemulti", "imcount", "haveImageReader", "haveImageWriter"),
    *("FileStorage", "putText", "getTextSize", "FontFace", "addText", "namedWindow", "imshow"),
}
"""Functions of OpenCV that take a name or a text."""


def calls(path):
    """Calls in a module that hand a name or a text to OpenCV, and imports by which it would hide one."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "cv2":
            yield "from cv2 import"
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "cv2" and node.attr in NAMES:
            yield node.attr
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("cv2.VideoCapture", "cv2.VideoWriter"):
            yield ast.unparse(node.func)


def test_one_module_hands_names_and_texts_to_opencv():
    found = {}
    for folder in ("vm_embedded", "export", "benchmarks", "deploy"):
        found |= {path.relative_to(CHECKOUT): set(calls(path)) for path in (CHECKOUT / folder).rglob("*.py")}
    own = found.pop(Path("vm_embedded/borders/opencv_text.py"))
    assert own == {"putText", "getTextSize", "cv2.VideoCapture", "cv2.VideoWriter"}
    assert not {path: each for path, each in found.items() if each}


names = st.binary(min_size=1, max_size=60).filter(
    lambda name: not {0, ord("/")} & set(name) and name not in (b".", b"..")
)


@given(names, names)
@example(b"t\xfcr", b"a:b%03d.\xe4")
@example("B\xe4lle".encode(), b"-x")
def test_a_library_opens_exactly_the_file_of_any_name(tmp_path_factory, folder, name):
    path = tmp_path_factory.mktemp("any") / os.fsdecode(folder) / os.fsdecode(name)
    path.parent.mkdir()
    path.write_bytes(name)
    before = len(list(Path("/proc/self/fd").iterdir()))
    with library_path(path) as given_name:
        given_name.encode()
        assert "%" not in given_name.removeprefix(str(path.parent.parent))
        assert Path(given_name).read_bytes() == name
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize(
    "name", ["f\udceflm", "a:b", "-x", "f%03d", "100%d/x", "t\udcfcr/film", "file:x", "B\xe4lle/\u30dc"]
)
@pytest.mark.parametrize("suffix", [".mp4", ".avi", ".webm"])
def test_a_film_of_any_name_is_written_and_read_as_a_whole(tmp_path, monkeypatch, name, suffix):
    monkeypatch.chdir(tmp_path)
    path = Path(name + suffix)
    path.parent.mkdir(exist_ok=True)
    with VideoFile(path, 10.0) as film:
        for index in range(4):
            film.write(np.full((48, 64, 3), 60 * index, np.uint8))
    assert [each.name for each in path.parent.iterdir()] == [path.name]
    frames = list(open_source(str(path)).frames)
    assert [each.read().shape for each in frames] == [(48, 64, 3)] * 4
    assert frames[0].stem == path.stem


@given(st.text(st.characters(), max_size=300))
@example("\ud800")
@example("b\udce4ll\0\n")
@example("x" * 100_000)
def test_any_text_can_be_drawn(text):
    canvas = np.zeros((40, 300, 3), np.uint8)
    Labels(canvas, 1.0).write(text, np.array([20.0, 20.0]), 2.0, (255, 255, 255))
    assert write_text(canvas, text, (5, 30), (255, 255, 255)) <= 300
    draw_text(canvas, text, (5, 30), 0.5, (255, 255, 255))
    assert text_size(text, 0.5)[0] < 20_000


def test_text_of_other_alphabets_is_drawn_as_opencv_draws_it():
    for text in ("B\xe4lle 1.38 m", "\u30dc\u30fc\u30eb"):
        canvas, expected = np.zeros((2, 40, 300, 3), np.uint8)
        draw_text(canvas, text, (5, 30), 0.5, (255, 255, 255))
        cv2.putText(expected, text, (5, 30), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        assert (canvas == expected).all()


@pytest.mark.parametrize("ending", ["\0x", "\ud800"])
def test_a_name_that_no_file_can_have_is_an_error_and_not_another_file(tmp_path, ending):
    (tmp_path / "a.avi").touch()
    for use in (lambda path: library_path(path).__enter__(), open_capture):
        with pytest.raises(OSError, match=r"zero byte|surrogates"):
            use(Path(f"{tmp_path}/a.avi{ending}"))


@pytest.mark.parametrize("ending", ["\0x", "\ud800"])
def test_an_address_that_is_no_text_is_an_error(ending):
    with pytest.raises(InputError):
        open_capture(f"rtsp://127.0.0.1:1/{ending}")
