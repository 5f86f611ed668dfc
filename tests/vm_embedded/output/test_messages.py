"""Features of the field in messages."""

import json
from dataclasses import replace

import pytest

from tests.messages import checked
from tests.vm_embedded.output.features import NOTHING, demo_frame, full, scene
from vm_embedded.output.messages import to_json_line


def fields_of(detections):
    """The fields of a frame; in a message, they are as its schema says."""
    fields = detections.as_dict()
    checked({"frame": 0, "source": "image.jpg", "stamp": None, **json.loads(to_json_line(fields))})
    return fields


@pytest.fixture(scope="module")
def detections():
    return demo_frame(6)[1]


def test_a_network_without_classes_of_the_field_has_no_field(detections):
    assert "field" not in fields_of(detections)
    empty = fields_of(replace(detections, field=NOTHING))["field"]
    assert empty["lines"] == empty["posts"] == []
    assert empty["circle"] is empty["border"] is None


def test_features_of_the_field_are_in_the_message(detections):
    made = scene(detections.observation.view)
    field = json.loads(to_json_line(fields_of(replace(detections, field=made))))["field"]
    assert field == made.as_dict()
    assert [each["class"] for each in field["robots"]] == ["robot", "robot"]
    assert field["goals"] == [[0, 1]]
    assert [each["kind"] for each in field["crossings"]] == ["L", "T", "X"]


def test_a_frame_full_of_lines_makes_a_short_line(detections):
    crowded = fields_of(replace(detections, field=full(detections.observation.view)))
    counts = {name: len(crowded["field"][name]) for name in ("lines", "crossings", "robots")}
    assert counts == {"lines": 60, "crossings": 40, "robots": 12}
    assert 8_000 < len(to_json_line(crowded)) < 14_000
    assert len(json.dumps(crowded)) < 15_000  # as for files


def test_a_pixel_that_the_lens_does_not_see_is_null(detections):
    made = scene(detections.observation.view)
    post = replace(made.posts[0], pixel=made.posts[0].pixel + float("nan"))
    fields = fields_of(replace(detections, field=replace(made, posts=(post,), goals=())))
    assert json.loads(to_json_line(fields))["field"]["posts"][0]["pixel"] == [None, None]
