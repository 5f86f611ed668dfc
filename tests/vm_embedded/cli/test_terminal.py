"""What programs print of names and paths that others chose, as a terminal and a file get it."""

import io
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.preloaded import LEARNING, run_preloaded
from vm_embedded.cli.program import program
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.cli.terminal import control_terminal, printable_output

BIN = Path(sys.executable).parent
ESCAPE = "\x1b]0;owned\x07\x1b[2J"


@given(st.text())
def test_what_is_printed_is_lines_of_printable_text(text):
    raw = io.BytesIO()
    given, sys.stdout = sys.stdout, (made := io.TextIOWrapper(raw, encoding="utf-8", newline="\n"))
    try:
        with printable_output():
            print(text, flush=True)
            print(text, end="", flush=True)
    finally:
        sys.stdout = given
    made.flush()
    for each in raw.getvalue().decode().split("\n"):
        assert each.isprintable()


def test_an_encoding_without_a_character_gets_its_escape(monkeypatch):
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="latin-1"))

    @program
    def main():
        print("Bälle ボール \udcff")
        return 0

    assert main() == 0
    assert raw.getvalue() == b"B\xe4lle \\u30dc\\u30fc\\u30eb \\udcff\n"


def test_streams_are_the_same_again_afterwards():
    before = sys.stdout, sys.stderr

    @program
    def fail():
        raise KeyboardInterrupt

    assert fail() == 130
    assert (sys.stdout, sys.stderr) == before


def test_the_programs_own_control_sequences_reach_the_terminal(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    with printable_output():
        control_terminal("\r\x1b[K")
        bar = ProgressBar(10)
        bar.advance()
        print(ESCAPE, file=sys.stderr)
        bar.clear()
    assert terminal.getvalue().startswith("\r\x1b[K\r[")
    assert "] 1/10 pictures, 0:00:0" in terminal.getvalue()
    assert "\\x1b]0;owned\\x07\\x1b[2J\n" in terminal.getvalue()
    assert set(re.findall("\x1b.*?[A-Za-z]", terminal.getvalue())) == {"\x1b[K"}


COCO = """{"images": [{"id": 1, "file_name": "a.png", "width": 64, "height": 48}],
"categories": [{"id": 1, "name": "\\u001b]0;owned\\u0007\\u001b[2J"}, {"id": 2, "name": "B\\u00e4lle \\u30dc"}],
"annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [10, 10, 20, 20]},
{"id": 2, "image_id": 1, "category_id": 2, "bbox": [10, 10, 20, 20]}]}"""


def on_terminal(*command, cwd):
    """What a program writes to a terminal, and its exit status."""
    master, slave = pty.openpty()
    process = subprocess.Popen([str(each) for each in command], stdout=slave, stderr=slave, cwd=cwd)
    os.close(slave)
    output = b""
    try:
        while piece := os.read(master, 65536):
            output += piece
    except OSError:  # the other end is closed
        pass
    os.close(master)
    return output, process.wait(120)


def control_characters(output):
    """Control characters in an output, without line ends and the sequences of a progress bar."""
    text = output.decode().replace("\r\n", "\n").replace("\r\x1b[K", "")
    text = re.sub(r"\r\[[#.]*\][^\x1b]*\x1b\[K", "", text)
    return [each for each in text if each != "\n" and not each.isprintable()]


@pytest.fixture
def image():
    import cv2
    import numpy as np

    return cv2.imencode(".png", np.full((48, 64, 3), 90, np.uint8))[1].tobytes()


def test_names_of_categories_do_not_control_the_terminal(tmp_path, image):
    (tmp_path / "a.png").write_bytes(image)
    (tmp_path / "a.json").write_text(COCO)
    output, status = on_terminal(BIN / "vm-train", "check", "--boxes", tmp_path, cwd=tmp_path)
    assert status == 1
    assert control_characters(output) == []
    assert b"owned" in output


@pytest.mark.long
@pytest.mark.parametrize("command", ["vm-train check --boxes", "vm-train check", "vm-label", "vm-synth check"])
def test_the_names_of_files_do_not_control_the_terminal(command, tmp_path, image):
    folder = tmp_path / f"a{ESCAPE.replace('/', '')}" / os.fsdecode(b"b\xff\n\x9bc")
    folder.mkdir(parents=True)
    for name in ("image1.png", f"image{ESCAPE}.png"):
        (folder / name).write_bytes(image)
        (folder / name).with_suffix(".txt").write_text("0 0.5 0.5 2 2\nx y\n")
    done = run_preloaded(
        [
            BIN / command.split()[0],
            *command.split()[1:],
            str(folder),
            *(["--write", str(folder)] * (command == "vm-label")),
        ],
        LEARNING,
        cwd=tmp_path,
    )
    assert done.returncode in (1, 2)
    assert "Traceback" not in done.stderr
    assert control_characters((done.stdout + done.stderr).encode()) == []
    assert "owned" in done.stdout + done.stderr


def test_an_image_with_such_a_name_is_detected_in(tmp_path, image):
    for name in (f"{ESCAPE}.png", os.fsdecode(b"\xff.png")):
        (tmp_path / name).write_bytes(image)
    done = run_preloaded(
        [BIN / "vm-detect", str(tmp_path), "--fov", "70", "--height", "0.5", "--pitch", "20deg"], cwd=tmp_path
    )
    assert control_characters((done.stdout + done.stderr).encode()) == []
