"""The binary form, read by the reader in the documentation."""

import math
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
from vm_embedded.output.binary_form import HEADER, LAYOUT, RECORDS, to_binary
from vm_embedded.output.messages import STATES, live_frame, state_message, to_json_line

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
    found = Tracker().update(found, 1.0) if tracked else found
    return checked(live_frame(2**32 + 812, "degraded", shot, found, now).as_dict())


def assert_same(record, expected, names):
    """The fields of a record are the numbers of the JSON form, under the same names."""
    for name in record.dtype.names:
        value = expected["track"][name.removeprefix("track_")] if name.startswith("track_") else expected[name]
        if name == "class":
            assert names[record[name]] == value
        elif name == "kind":
            assert "LTX"[record[name]] == value
        else:
            np.testing.assert_allclose(record[name], np.array(value, float), rtol=1e-6)


@pytest.mark.parametrize("make", [scene, full])
def test_the_reader_of_the_documentation_reads_all_that_a_frame_has(tmp_path, capsys, make):
    message = frame_message(make)
    got = read(tmp_path, state_message("starting", ""), message)
    header, found, field, names = got["header"], got["found"], message["field"], got["names"]
    assert (header["is_frame"], STATES[header["state"]], header["field"], header["frame"]) == (1, "degraded", 1, 812)
    assert (header["t"], header["wall"], header["points"]) == (message["t"], message["wall"], message["points"])
    for name in ("age_ms", "latency_ms"):
        assert header[name] == pytest.approx(message[name], abs=1e-3)
    times = [each for each in header["timing_ms"].tolist() if not math.isnan(each)]
    assert times == pytest.approx(list(message["timing_ms"].values()), abs=1e-3)
    assert names == ["ball", "post", "robot"]
    groups = {name: field[name] for name in ("posts", "robots", "lines", "crossings")}
    groups |= {"detections": message["detections"], "circle": [field["circle"]]}
    for name, expected in groups.items():
        assert len(found[name]) == len(expected) > 0
        for record, each in zip(found[name], expected, strict=True):
            assert_same(record, each, names)
    assert found["goals"]["goals"].tolist() == [[0, 1]]
    for name in ("points", "pixels"):
        np.testing.assert_allclose(found["border"][name], field["border"][name], rtol=1e-6)
    assert "ball" in capsys.readouterr().out


def test_a_state_has_its_reason_and_no_records(tmp_path):
    message = state_message("camera_lost", "no new frame for 1.0 s - 10 µs late")
    got = read(tmp_path, message)
    header = got["header"]
    assert (header["is_frame"], STATES[header["state"]], got["text"]) == (0, "camera_lost", message["reason"])
    assert (header["t"], header["wall"]) == (message["t"], message["wall"])
    assert not any(len(each) for each in got["found"].values())


def test_a_network_without_classes_of_the_field_has_no_field(tmp_path):
    got = read(tmp_path, frame_message(None))
    assert got["header"]["field"] == 0
    assert {name for name, records in got["found"].items() if len(records)} == {"detections"}


def test_an_object_without_a_track_has_the_number_0(tmp_path):
    (record,) = read(tmp_path, frame_message(None, tracked=False))["found"]["detections"]
    assert record["track_id"] == 0
    for name in ("track_position", "track_velocity", "track_position_error", "track_velocity_error"):
        assert np.isnan(record[name]).all()


def test_a_pixel_that_the_lens_does_not_see_is_nan(tmp_path):
    message = frame_message(scene)
    message["field"]["robots"] = [message["field"]["robots"][0] | {"pixel": [None, None]}]
    (robot,) = read(tmp_path, message)["found"]["robots"]
    assert np.isnan(robot["pixel"]).all()


def test_a_full_frame_is_a_third_of_its_line():
    message = frame_message(full)
    assert 3 * len(to_binary(message)) < len(to_json_line(message)) + 1000


def test_the_layout_of_the_documentation_is_that_of_the_detector(tmp_path):
    found = read(tmp_path, state_message("ok", ""))
    assert (found["HEADER"], found["TYPES"], found["NUMBER"]) == (HEADER, RECORDS, LAYOUT)


@pytest.mark.long
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
    assert variables["header"]["is_frame"] == 0
    assert STATES[variables["header"]["state"]] == "stopping"
    assert numbers
