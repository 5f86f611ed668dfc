"""Lines for people: at a terminal and with --no-json; elsewhere and with --json, lines are JSON."""

import json
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.drawn_scenes import IMAGES, MODEL
from tests.programs import BIN
from vm_embedded.output.readable_line import to_readable_line

from .commands import detect, one_complaint, run
from .test_terminal import on_terminal

TOP = Path(__file__).parents[3]
DEMO = TOP / "tests" / "fixtures" / "demo" / "image0000002.jpg"
LINE = re.compile(r"(\S+)  (no objects|\d+ \w+[^\n]*)  \d+\.\d ms")


def test_a_terminal_gets_a_line_for_people_with_what_the_json_says(tmp_path):
    output, status = on_terminal(BIN / "vm-detect", IMAGES[0], "--model", MODEL, cwd=tmp_path)
    assert status == 0
    name, found = LINE.fullmatch(output.decode().strip()).groups()
    (line,) = map(json.loads, detect(IMAGES[0]).stdout.splitlines())
    assert name == line["source"]
    (ball,) = line["detections"]
    assert found.startswith(f"1 ball {ball['distance']:.2f} m")


@pytest.mark.parametrize("options", [["--json"], ["--emit-points", "ball"]])
def test_json_and_points_are_json_at_a_terminal_too(options, tmp_path):
    output, status = on_terminal(BIN / "vm-detect", IMAGES[0], "--model", MODEL, *options, cwd=tmp_path)
    assert status == 0
    assert json.loads(output)["source"] == IMAGES[0].name


@pytest.mark.long
def test_a_live_camera_prints_a_line_for_each_frame_and_no_states(folder):
    options = "--live", "--no-json", "--model", MODEL, "--camera-fps", "2", "--camera-max-age-ms", "10000"
    lines = run(folder, *options).stdout.splitlines()
    assert lines
    for line in lines:
        assert re.match(r"frame \d+  (degraded  |stopping  )?(no objects|\d+ ball)", line), line
    messages = map(json.loads, run(folder, *options, "--json").stdout.splitlines())
    assert {each["type"] for each in messages} == {"frame", "state"}


@pytest.mark.long
def test_make_demo_prints_lines_for_people_into_a_pipe(tmp_path):
    made = subprocess.run(["make", "--dry-run", "demo"], cwd=TOP, capture_output=True, text=True, check=True)
    (command,) = [each for each in made.stdout.splitlines() if "vm-detect" in each]
    _, *words = shlex.split(command)
    lines = run(*(tmp_path if each == "demo-out" else each for each in words), cwd=TOP).stdout.splitlines()
    assert len(lines) == 12
    assert all(LINE.fullmatch(each) for each in lines)
    assert sum(" ball" in each for each in lines) >= 9
    assert {kind for each in lines for kind in ("post", "robot") if kind in each} == {"post", "robot"}


def test_points_need_json():
    one_complaint(detect(IMAGES[0], "--emit-points", "ball", "--no-json", code=1), "--emit-points", "--no-json")


def test_rejected_candidates_follow_in_lines_of_their_own():
    first, *rejected = run(DEMO, "--no-json", "--explain").stdout.splitlines()
    assert LINE.fullmatch(first)
    assert rejected
    assert all(re.match(r" +rejected: ball \d\.\d\d \d+\.\d\d m: \w+", each) for each in rejected)


def frame(*objects, **more):
    detections = [{"class": name, "confidence": 0.5, "distance": distance} for name, distance in objects]
    return {"frame": 7, "detections": detections, "timing_ms": {"mesh": 1.0, "total": 14.84}} | more


@pytest.mark.parametrize(
    ("message", "line"),
    [
        (frame(("ball", 1.384), source="a.jpg", stamp=None), "a.jpg  1 ball 1.38 m  14.8 ms"),
        (frame(source="a b.mp4", stamp=12.4), "a b.mp4  12.40 s  no objects  14.8 ms"),
        (
            frame(("box", 1), ("cup", 2), ("box", 3), state="ok"),
            "frame 7  2 boxes 1.00 m and 3.00 m, 1 cup 2.00 m  14.8 ms",
        ),
        (
            frame(("ball", 1), ("ball", 2), ("ball", 3), state="degraded"),
            "frame 7  degraded  3 balls 1.00 m, 2.00 m and 3.00 m  14.8 ms",
        ),
        (
            frame(source="a", field={"posts": [{"class": "post"}], "robots": [{"class": "robot"}] * 3}),
            "a  1 post, 3 robots  14.8 ms",
        ),
        (frame(source="\x1b[2J\n"), r"\x1b[2J\n  no objects  14.8 ms"),
    ],
)
def test_line(message, line):
    assert to_readable_line(message) == line


def test_a_track_stands_before_the_distance():
    message = frame(("ball", 1.384), source="a")
    message["detections"][0]["track"] = {"id": 3}
    assert to_readable_line(message) == "a  1 ball #3 1.38 m  14.8 ms"
