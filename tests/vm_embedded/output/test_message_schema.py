"""The published schema: every kind of message fits it, and nothing else does."""

import copy
import json
import time
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from tests.messages import SCHEMA, kind_of, read_message, validator
from tests.vm_embedded.cli.commands import lines, run
from tests.vm_embedded.live.running import DEMO, running
from tests.vm_embedded.output.features import demo_frame, scene
from vm_embedded import Tracker
from vm_embedded.cameras.camera import Shot
from vm_embedded.live.control import ask
from vm_embedded.output.messages import live_frame, state_message, to_json_line


def complete_frame():
    """A message of a live camera with all fields that it may have, but those for synthetic cameras."""
    image, detections = demo_frame(6)
    detections = replace(detections, field=scene(detections.observation.view))
    now = time.monotonic()
    shot = Shot(image, now - 0.02, arrived=now - 0.01)
    return live_frame(7, "ok", shot, Tracker().update(detections, 1.0), now).as_dict()


@pytest.fixture(scope="module")
def messages():
    frame = complete_frame()
    state = state_message("camera_lost", "no new frame for 1.0 s")
    return [json.loads(to_json_line(each)) for each in (frame, state)]


def test_the_schema_is_one():
    Draft202012Validator.check_schema(json.loads(SCHEMA.read_text()))


def test_each_message_is_of_one_kind(messages):
    assert [kind_of(each) for each in messages] == ["frame", "state"]
    for each in messages:
        validator("").validate(each)


@pytest.mark.long
def test_files_with_all_options_and_a_status_fit(tmp_path):
    options = ("--model", "soccer", "--explain", "--emit-points", "field,line", "--track", "--camera-fps", 10)
    for each in lines(run(DEMO, *options)):
        validator("").validate(each)
        assert each.keys() >= {"rejected", "class_points", "field"}
    with running(tmp_path, "--camera", "synthetic") as found:
        for state in ("starting", "ok"):
            found.wait_for_state(state)
            status = read_message(ask(tmp_path / "control", "status"))
            validator("").validate(status)
        assert kind_of(status) == "status"
        found.wait(lambda: found.frames)
        assert "truth" in found.frames[0]
        validator("").validate(found.frames[0])
        found.stop()


def tables(value):
    """All tables in a message, but those with free names."""
    if isinstance(value, dict):
        yield value
        for each in value.values():
            yield from tables(each)
    elif isinstance(value, list):
        for each in value:
            yield from tables(each)


@given(st.data())
def test_a_field_too_much_or_too_few_or_of_another_type_is_found(messages, data):
    message = copy.deepcopy(data.draw(st.sampled_from(messages)))
    table = data.draw(st.sampled_from([each for each in tables(message) if each]))
    optional = {"field", "track", "reason"} - (set() if message is table else {"reason"})
    stages = "total" in table
    change = data.draw(st.sampled_from(("more", "fewer", "type")))
    name = data.draw(st.sampled_from(sorted(table)))
    if change == "more":
        table["novel"] = 1
    elif change == "fewer" and not stages and (name not in optional or kind_of(message) == "state"):
        del table[name]
    else:
        table[name] = "novel" if not isinstance(table[name], str) else 1.5
    assert not validator("").is_valid(message), (change, name)
