"""Look networks in model files: what fits is read and run, what does not is refused in one line."""

import json
from dataclasses import replace

import numpy as np
import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.looks import (
    look_contract,
    manifest_with_look,
    model_with,
    random_patches,
    small_answers,
    small_look,
    upright,
)
from tests.manifests import ball_manifest
from vm_embedded.errors import ModelError
from vm_embedded.network.look_contract import JudgedClass, LookContract
from vm_embedded.network.look_example import LookTest
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook

from ..strategies import attempt, class_names, printable, reals, seeds

LOOK = small_look(classes=2)
PATCHES = random_patches(3)
TEST = LookTest(PATCHES, small_answers(PATCHES, classes=2))
MANIFEST = manifest_with_look(self_test=TEST)


@pytest.fixture
def load(tmp_path):
    """Write a model file, read it, and load its look network."""

    def loaded(look=LOOK, manifest=MANIFEST):
        path = tmp_path / "model.onnx"
        path.write_bytes(model_with(look, manifest))
        return CloseLook.of(read_model(path))

    return loaded


def mixture_of(model):
    """The only weights of `small_look`."""
    return next(each for each in model.graph.initializer if each.name == "mixture")


def refusal(load, *arguments, **named):
    """The message with which a look is refused: one line, which names the file."""
    with pytest.raises(ModelError) as caught:
        load(*arguments, **named)
    message = str(caught.value)
    assert "model.onnx" in message
    assert len(message.splitlines()) == 1
    return message


@pytest.mark.parametrize("count", [0, 1, 2, 40])
def test_a_look_answers_for_any_number_of_patches(load, count):
    patches = random_patches(count, seed=count)
    answers = load().run(patches)
    assert answers.shape == (count, 2, 4)
    assert answers.dtype == np.float32
    np.testing.assert_allclose(answers, small_answers(patches, classes=2), atol=1e-5)


def test_a_look_keeps_its_contract(load):
    contract = load().contract
    assert replace(contract, self_test=None) == replace(MANIFEST.look, self_test=None)
    np.testing.assert_array_equal(contract.self_test.patches, PATCHES)


def test_a_look_without_a_self_test_is_run(load):
    assert load(manifest=manifest_with_look()).run(PATCHES).shape == (3, 2, 4)


def test_a_model_without_a_look_has_none(load):
    assert load(None, ball_manifest()) is None


@pytest.mark.parametrize("number", [0, 1])
def test_the_self_test_catches_other_weights_of_each_class(load, number):
    model = onnx.load_from_string(LOOK)
    mixture = mixture_of(model)
    changed = onnx.numpy_helper.to_array(mixture).copy()
    changed[:, 4 * number : 4 * number + 4] *= 1.1
    mixture.CopyFrom(onnx.numpy_helper.from_array(changed, mixture.name))
    assert "model.onnx, close look: self-test failed" in refusal(load, model.SerializeToString())


@pytest.mark.parametrize("weight", [np.nan, np.inf])
def test_answers_that_are_not_finite_are_an_error(load, weight):
    model = onnx.load_from_string(LOOK)
    mixture = mixture_of(model)
    broken = np.full_like(onnx.numpy_helper.to_array(mixture), weight)
    mixture.CopyFrom(onnx.numpy_helper.from_array(broken, mixture.name))
    look = load(model.SerializeToString(), manifest_with_look(self_test=None))
    with pytest.raises(ModelError, match="its answers are NaN or infinite"):
        look.run(PATCHES)


def test_the_self_test_catches_answers_that_are_not_numbers(load):
    test = LookTest(PATCHES, np.full((3, 2, 4), np.nan, dtype=np.float32))
    assert "self-test failed" in refusal(load, manifest=manifest_with_look(self_test=test))


@pytest.mark.parametrize(
    ("look", "manifest", "message"),
    [
        (None, MANIFEST, "its manifest has a close look, its metadata has none"),
        (LOOK, ball_manifest(), "its metadata has a close look, its manifest has none"),
        ("", ball_manifest(), "its metadata has a close look, its manifest has none"),
        ("", MANIFEST, "not an ONNX file"),
        ("AAA", MANIFEST, "its close look can't be read"),
        ("@@@@", MANIFEST, "its close look can't be read"),
        ("größer", MANIFEST, "its close look can't be read"),
        (b"no graph", MANIFEST, "not an ONNX file"),
        (LOOK[: len(LOOK) // 2], MANIFEST, "its close look can't be read: not an ONNX file"),
        (LOOK[:-1], MANIFEST, "its close look can't be read: not an ONNX file"),
        (small_look(classes=2, size=16), MANIFEST, "its inputs and outputs are"),
        (small_look(classes=2, width=3), MANIFEST, "its inputs and outputs are"),
        (small_look(classes=1), MANIFEST, "its inputs and outputs are"),
        (small_look(classes=3), MANIFEST, "its inputs and outputs are"),
        (model_with(None, MANIFEST), MANIFEST, "its inputs and outputs are"),
    ],
    ids=str,
)
def test_what_does_not_fit_is_refused(load, look, manifest, message):
    assert message in refusal(load, look, manifest)


def test_external_data_in_a_look_is_refused(load):
    model = onnx.load_from_string(LOOK)
    mixture = mixture_of(model)
    mixture.ClearField("raw_data")
    mixture.data_location = onnx.TensorProto.EXTERNAL
    mixture.external_data.add(key="location", value="secret.bin")
    assert "its close look can't be read: refers to external data" in refusal(load, model.SerializeToString())


def test_a_look_that_onnx_runtime_can_not_load_is_refused(load):
    model = onnx.load_from_string(LOOK)
    model.graph.node[0].op_type = "NoSuchOperator"
    assert "model.onnx, close look: ONNX Runtime can't load it" in refusal(load, model.SerializeToString())


@pytest.mark.parametrize("name", ["post", "other", "Ball"])
def test_a_look_at_a_class_without_peaks_is_refused(name):
    with pytest.raises(ModelError, match=rf"a close look judges '{name}'.*peaks for \['ball', 'goal'\]"):
        replace(MANIFEST, look=look_contract("ball", upright(name)))


def from_json(**changes):
    """The manifest after changes in the JSON of its look; an Ellipsis takes an entry away."""
    data = json.loads(MANIFEST.as_json())
    data["look"] = {key: value for key, value in (data["look"] | changes).items() if value is not ...}
    return Manifest.from_json(json.dumps(data))


def with_goal(**changes):
    """The manifest after changes in the JSON of the look's second class; an Ellipsis takes an entry away."""
    ball, goal = MANIFEST.look.as_dict()["classes"]
    return from_json(classes=[ball, {key: value for key, value in (goal | changes).items() if value is not ...}])


@pytest.mark.parametrize("entry", sorted(look_contract().as_dict()))
def test_a_missing_entry_is_refused(entry):
    with pytest.raises(ModelError, match=rf"look in the model's manifest must have the entries .*'{entry}'"):
        from_json(**{entry: ...})


def test_an_unknown_entry_is_refused():
    with pytest.raises(ModelError, match="'depth'"):
        from_json(depth=3)


@pytest.mark.parametrize("look", [[], [MANIFEST.look.as_dict()], 1, 0, "look", True, False, {}])
def test_a_look_that_is_no_table_is_refused(look):
    data = json.loads(MANIFEST.as_json()) | {"look": look}
    with pytest.raises(ModelError, match="must have the entries"):
        Manifest.from_json(json.dumps(data))


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("classes", None),
        ("classes", 1),
        ("classes", []),
        ("classes", {}),
        ("classes", "ball"),
        ("classes", ["ball"]),
        ("classes", [{}]),
        ("classes", [{"name": "ball", "color": "red"}]),
        ("size", 7),
        ("size", 129),
        ("size", 8.0),
        ("size", "8"),
        ("extent", 0.4),
        ("extent", 9),
        ("extent", True),
        ("extent", float("nan")),
        ("max_proposals", 0),
        ("max_proposals", 129),
        ("max_proposals", None),
        ("channels", 3),
        ("channels", ["many"]),
        ("channels", [float("inf")]),
        ("provenance", []),
        ("self_test", []),
        ("self_test", 1),
        ("self_test", {}),
        ("self_test", {"patches": "AAAA", "answers": [[[0, 0, 0, 0], [0, 0, 0, 0]]]}),
        ("self_test", TEST.as_dict() | {"patches": "AAA"}),
        ("self_test", TEST.as_dict() | {"patches": 3}),
        ("self_test", TEST.as_dict() | {"answers": [[1, 2], [3]]}),
        ("self_test", TEST.as_dict() | {"answers": [1, 2, 3]}),
        ("self_test", TEST.as_dict() | {"answers": [[0, 0, 0, 0]] * 3}),  # for one class
    ],
)
def test_a_malformed_entry_is_refused(entry, value):
    with pytest.raises(ModelError, match=entry.replace("self_test", "self-test")) as caught:
        from_json(**{entry: value})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("entry", "value", "message"),
    [
        ("name", ..., "name"),
        ("name", 1, "a class of the close look must be a name, not 1"),
        ("name", None, "a class of the close look must be a name, not None"),
        ("name", ["goal"], "a class of the close look must be a name"),
        ("name", "", "a class of the close look "),
        ("name", "ball", r"at least one, and differ, not \['ball', 'ball'\]"),
        ("upright_radius", -0.1, "upright_radius of the close look must be a number from 0 to 100, not -0.1"),
        ("upright_radius", 101, "upright_radius .*not 101"),
        ("upright_radius", float("nan"), "upright_radius .*not nan"),
        ("upright_radius", "0.3", "upright_radius .*not '0.3'"),
        ("mesh_weight", 100.1, "mesh_weight of the close look must be a number from 0 to 100, not 100.1"),
        ("mesh_weight", -0.1, "mesh_weight"),
        ("mesh_weight", True, "mesh_weight"),
        ("mesh_weight", None, "mesh_weight"),
        ("depth", 3, "depth"),
        ("a\nb\x1b[2J", 3, "classes"),
    ],
    ids=repr,
)
def test_a_malformed_entry_of_a_class_is_refused_in_a_line(entry, value, message):
    with pytest.raises(ModelError, match=message) as caught:
        with_goal(**{entry: value})
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("names", [(), ("ball", "ball"), ("ball", "goal", "ball"), ("",), ("ball", "")], ids=repr)
def test_classes_of_a_contract_are_some_with_different_names(names):
    with pytest.raises(ModelError, match="class"):
        LookContract(classes=tuple(JudgedClass(name=each) for each in names), size=8, extent=1.75, max_proposals=10)


@st.composite
def contracts(draw):
    size, count = draw(st.integers(8, 16)), draw(st.integers(0, 3))
    random = np.random.default_rng(draw(seeds))
    names = draw(st.lists(class_names, min_size=1, max_size=4, unique=True))
    patches = random.integers(0, 256, (count, size, size, 3), dtype=np.uint8)
    test = LookTest(patches, random.normal(size=(count, len(names), 4)).astype(np.float32))
    numbers = st.just(0.0) | reals(0.0, 100.0)
    return look_contract(
        *(upright(each, draw(numbers), draw(numbers)) for each in names),
        size=size,
        extent=draw(reals(0.5, 8.0)),
        max_proposals=draw(st.integers(1, 128)),
        channels=tuple(draw(st.lists(st.integers(1, 99), max_size=4))),
        self_test=draw(st.sampled_from([None, test])),
        provenance=draw(st.dictionaries(class_names, st.text(printable, max_size=8), max_size=3)),
    )


@given(contracts())
def test_a_contract_is_read_back_as_it_was_written(contract):
    again = LookContract.from_dict(json.loads(json.dumps(contract.as_dict())))
    assert replace(again, self_test=None) == replace(contract, self_test=None)
    assert again.as_dict() == contract.as_dict()
    if contract.self_test is not None:
        np.testing.assert_array_equal(again.self_test.patches, contract.self_test.patches)
        np.testing.assert_allclose(again.self_test.answers, contract.self_test.answers, atol=1e-6)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
)


@given(st.sampled_from(sorted(look_contract().as_dict())), json_values)
def test_any_value_of_an_entry_is_read_or_refused_with_a_model_error(entry, value):
    found = attempt(ModelError, LookContract.from_dict, MANIFEST.look.as_dict() | {entry: value})
    assert isinstance(found, LookContract | ModelError)


def test_the_look_is_in_the_manifest_s_json():
    data = json.loads(MANIFEST.as_json())
    assert data["look"]["size"] == 8
    assert [each["name"] for each in data["look"]["classes"]] == ["ball", "goal"]
    assert METADATA_KEY not in data
    assert json.loads(ball_manifest().as_json())["look"] is None
