import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import ModelError
from vm_embedded.network.canary import PACKAGE_PICTURE, Canary, CanaryObject

numbers = st.floats(0.01, 5000.0)
objects = st.builds(CanaryObject, st.text(max_size=5), st.tuples(numbers, numbers), numbers)
canaries = st.builds(
    Canary,
    st.binary(max_size=50),
    st.text(max_size=20),
    st.lists(objects, max_size=3).map(tuple),
    st.dictionaries(st.text(max_size=5), st.integers(0, 5000), max_size=3),
)

VALID = json.loads(Canary(b"picture", "lens", (CanaryObject("ball", (1.0, 2.0), 3.0),), {"ball": 4}).as_json())


@given(canaries)
def test_a_canary_round_trips(canary):
    assert Canary.from_json(canary.as_json()) == canary


def test_of_the_picture_of_the_package_a_model_file_has_only_the_hash():
    canary = Canary(PACKAGE_PICTURE.read_bytes(), "lens", (), {})
    assert len(canary.as_json()) < 200
    assert Canary.from_json(canary.as_json()) == canary
    other = canary.as_json().replace("sha256:", "sha256:0")
    with pytest.raises(ModelError, match="not the one of this release"):
        Canary.from_json(other)


OBJECT = VALID["objects"][0]


@pytest.mark.parametrize(
    "wrong",
    [
        [],
        3,
        {},
        VALID | {"picture": "ü"},
        VALID | {"picture": 3},
        VALID | {"picture": None},
        VALID | {"lens": None},
        VALID | {"objects": 3},
        VALID | {"objects": [{}]},
        VALID | {"objects": [OBJECT | {"center": [1.0]}]},
        VALID | {"objects": [OBJECT | {"center": [1.0, "x"]}]},
        VALID | {"objects": [OBJECT | {"radius": 0}]},
        VALID | {"objects": [OBJECT | {"radius": float("nan")}]},
        VALID | {"objects": [OBJECT | {"class_name": 3}]},
        VALID | {"points": []},
        VALID | {"points": {"ball": "many"}},
        VALID | {"points": {"ball": float("inf")}},
    ],
)
def test_a_canary_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ModelError, match="canary can't be read"):
        Canary.from_json(json.dumps(wrong))


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000])
def test_text_that_is_not_json_is_refused(text):
    with pytest.raises(ModelError, match="canary can't be read"):
        Canary.from_json(text)
