"""Another program in turns with ours, over its protocol of lines."""

import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]

ENGINE = """
import pathlib, sys
for line in sys.stdin:
    image, lens = map(pathlib.Path, line.rstrip("\\n").split("\\t"))
    assert image.read_bytes()[:2] == b"\\xff\\xd8" and "projection" in lens.read_text()
    print({answer}, flush=True)
"""


def compare(*arguments):
    command = [sys.executable, "-m", "benchmarks.external", *arguments]
    return subprocess.run(command, cwd=TOP, capture_output=True, text=True, timeout=300)


def engine(tmp_path, answer):
    (tmp_path / "engine.py").write_text(ENGINE.format(answer=answer))
    return f"{sys.executable} {tmp_path / 'engine.py'}"


def test_both_are_timed_on_the_same_pictures(tmp_path):
    done = compare(engine(tmp_path, 4000.0), "--rounds", "1", "--model", "ball")
    assert done.returncode == 0, done.stderr
    rows = [line.split("|") for line in done.stdout.splitlines()[2:4]]
    assert [float(each[2]) for each in rows][1] == 4000.0
    assert 0.0 < float(rows[0][2]) < 4000.0
    assert "theirs / ours: " in done.stdout


@pytest.mark.parametrize("answer", ["'soon'", "-1.0", "float('nan')"])
def test_an_answer_that_is_not_a_time_is_named(tmp_path, answer):
    done = compare(engine(tmp_path, answer), "--rounds", "1")
    assert done.returncode == 1
    assert "must answer with milliseconds" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["true", "/no/such/engine", ""])
def test_a_program_that_does_not_run_is_named(command):
    done = compare(command, "--rounds", "1")
    assert done.returncode == 1
    assert f"{command!r}" in done.stderr
    assert "Traceback" not in done.stderr
