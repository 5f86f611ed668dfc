"""The binary form, read by the reader in the documentation."""

import re
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.messages import checked
from tests.vm_embedded.live.running import running
from tests.vm_embedded.output.features import demo_frame, full, scene
from vm_embedded import Tracker
from vm_embedded.cameras.camera import Shot
from vm_embedded.output.binary_form import HEADER, RECORDS, VERSION, to_binary
from vm_embedded.output.messages import STATES, live_message, state_message, to_json_line

PAGE = (Path(__file__).parents[3] / "docs" / "daemon.md").read_text()
PATH = "/run/vm-detect/lines.sock"
(READER,) = (
    each for each in re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL) if "np.frombuffer" in each
)


def reader(path):
    """The program in the documentation, for another socket."""
    assert READER.count(PATH) == 1
    return READER.replace(PATH, str(path))


def read(tmp_path, *messages):
    """The variables of the documentation's reader after the last of these messages."""
    path = tmp_path / "lines"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()

        def serve():
            connection, _ = listening.accept()
            with connection:
                connection.sendall(b"".join(map(to_binary, messages)))

        thread = threading.Thread(target=serve)
        thread.start()
        variables = {}
        exec(reader(path), variables)
        thread.join()
    path.unlink()
    return variables


def frame_message(make, tracked=True):
    image, detections = demo_frame(6)
    now = time.monotonic()
    field = make and make(detections.observation.view)
    shot = Shot(image, now - 0.02, arrived=now - 0.01)
    found = replace(detections, field=field)
    return checked(live_message(2**32 + 812, "degraded", shot, Tracker().update(found, 1.0) if tracked else found, now))


def assert_same(record, expected, names):
    """The fields of a record are the numbers of the JSON form."""
    for name in record.dtype.names:
        value = expected["track"][name.removeprefix("track_")] if name.startswith("track_") else expected[name]
        if name == "track":
            assert record[name] == value["id"] > 0
        elif name == "class":
            assert names[record[name]] == value
        elif name == "kind":
            assert chr(record[name]) == value
        else:
            np.testing.assert_allclose(record[name], np.array(value, float), rtol=1e-6)


@pytest.mark.parametrize("make", [scene, full])
def test_the_reader_of_the_documentation_reads_all_that_a_frame_has(tmp_path, capsys, make):
    message = frame_message(make)
    got = read(tmp_path, state_message("starting", ""), message)
    assert (got["kind"], STATES[got["state"]], got["has_field"]) == (1, "degraded", 1)
    assert (got["t"], got["wall"], got["frame"]) == (message["t"], message["wall"], 812)
    assert got["points"] == message["points"]
    assert got["age_ms"] == pytest.approx(message["age_ms"], abs=1e-3)
    assert got["latency_ms"] == pytest.approx(message["latency_ms"], abs=1e-3)
    assert got["total_ms"] == pytest.approx(message["timing_ms"]["total"], abs=1e-3)
    found, field, names = got["found"], message["field"], got["text"].splitlines()
    assert names == ["ball", "post", "robot"]
    groups = {name: field[name] for name in ("posts", "robots", "lines", "crossings")}
    groups |= {"detections": message["detections"], "circle": [field["circle"]]}
    for name, expected in groups.items():
        assert len(found[name]) == len(expected) > 0
        for record, each in zip(found[name], expected, strict=True):
            assert_same(record, each, names)
    assert found["goals"].tolist() == [(0, 1)]
    np.testing.assert_allclose(found["border"]["point"], field["border"]["points"], rtol=1e-6)
    np.testing.assert_allclose(found["border"]["pixel"], field["border"]["pixels"], rtol=1e-6)
    assert "ball" in capsys.readouterr().out


def test_a_state_has_its_reason_and_no_records(tmp_path):
    message = state_message("camera_lost", "no new frame for 1.0 s - 10 µs late")
    got = read(tmp_path, message)
    assert (got["kind"], STATES[got["state"]], got["text"]) == (0, "camera_lost", message["reason"])
    assert (got["t"], got["wall"]) == (message["t"], message["wall"])
    assert not any(len(each) for each in got["found"].values())


def test_a_network_without_classes_of_the_field_has_no_field(tmp_path):
    got = read(tmp_path, frame_message(None))
    assert got["has_field"] == 0
    assert {name for name, records in got["found"].items() if len(records)} == {"detections"}


def test_an_object_without_a_track_has_the_number_0(tmp_path):
    (record,) = read(tmp_path, frame_message(None, tracked=False))["found"]["detections"]
    assert record["track"] == 0
    for name in ("track_position", "track_velocity", "track_position_error", "track_velocity_error"):
        assert np.isnan(record[name]).all()


def test_a_pixel_that_the_lens_does_not_see_is_nan():
    message = frame_message(scene)
    message["field"]["robots"] = [message["field"]["robots"][0] | {"pixel": [None, None]}]
    size = to_binary(message)
    assert np.isnan(np.frombuffer(size, RECORDS["robots"], 1, _offset(message, "robots"))["pixel"]).all()


def _offset(message, wanted):
    """Bytes before the records of a kind."""
    counts = HEADER.unpack_from(to_binary(message))[12:]
    names = list(RECORDS)
    return HEADER.size + sum(
        RECORDS[name].itemsize * count for name, count in zip(names[: names.index(wanted)], counts, strict=False)
    )


def test_a_full_frame_is_a_third_of_its_line():
    message = frame_message(full)
    assert 3 * len(to_binary(message)) < len(to_json_line(message)) + 1000


def test_a_text_that_is_too_long_is_cut(tmp_path):
    got = read(tmp_path, state_message("degraded", "x" * 70_000), state_message("ok", "y" * 70_000))
    assert got["text"] == "y" * 65_535


def test_the_tables_of_the_documentation_are_the_layout(tmp_path):
    assert VERSION == 3
    assert read(tmp_path, state_message("ok", ""))["TYPES"] == RECORDS
    section = PAGE.split("### Binary form")[1].split("\n## ")[0]
    sizes = {name: int(size) for name, size in re.findall(r"^\| `(\w+)` \| (\d+) \|", section, re.MULTILINE)}
    assert sizes == {name: dtype.itemsize for name, dtype in RECORDS.items()}
    rows = re.findall(r"^\| (\d+) \| (\w+)(?: x (\d+))? \|", section, re.MULTILINE)
    widths = {"u8": 1, "u16": 2, "u32": 4, "f32": 4, "f64": 8}
    offset = 0
    for at, kind, count in rows:
        assert int(at) == offset
        offset += widths[kind] * int(count or 1)
    assert offset == HEADER.size
    assert all(f"{number} `{name}`" in section for number, name in enumerate(STATES))


def test_a_detector_sends_lines_and_the_binary_form_at_once(tmp_path):
    path = tmp_path / "lines"
    options = ("--camera", "synthetic", "--output-unix", path, "--output-unix-format", "binary")
    with running(tmp_path, *options) as found:
        found.wait_for_state("ok")
        stopper = threading.Timer(2.0, found.stop)
        stopper.start()
        variables = {}
        exec(reader(path), variables)
        stopper.join()
        numbers = {each["frame"] for each in found.frames}
    assert variables["kind"] == 0
    assert STATES[variables["state"]] == "stopping"
    assert numbers
