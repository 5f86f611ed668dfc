"""A shipped model with changed weights is refused before it changes an answer on the demo.

The checksum finds all damage. Somebody who changes weights can compute a new checksum; then the self-tests and the
canary must find it.
"""

import base64
import math
import random
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from vm_embedded.detection.detector import Detector
from vm_embedded.errors import ModelError
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.live.proof import prove
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.network.look_contract import LOOK_KEY
from vm_embedded.network.model_file import SEAL_KEY, parse_model, sealed

pytest.importorskip("onnxruntime")

DEMO = Path(__file__).parents[2] / "fixtures/demo"
LARGEST_CHANGE = 1e-3


def networks_of(content):
    """A model file, and its networks by the key of their metadata; None is the mesh network."""
    model = onnx.load_from_string(content)
    entries = {each.key: each.value for each in model.metadata_props}
    inner = {key: onnx.load_from_string(base64.b64decode(entries[key])) for key in (LOOK_KEY,) if key in entries}
    return model, {None: model, **inner}


def sealed_again(model, networks):
    """The bytes of a model file with these networks and a right checksum."""
    entries = {each.key: each.value for each in model.metadata_props if each.key != SEAL_KEY}
    entries |= {key: base64.b64encode(net.SerializeToString()).decode() for key, net in networks.items() if key}
    helper.set_model_props(model, entries)
    return sealed(model.SerializeToString())


def corrupted(content, chance, keys=None):
    """A model file with wrong weights in one of its networks, or of those with these keys, and what is wrong."""
    model, networks = networks_of(content)
    key = chance.choice(list(networks if keys is None else keys))
    weights = [
        each
        for each in networks[key].graph.initializer
        if each.data_type in (TensorProto.FLOAT, TensorProto.FLOAT16) and each.name.endswith((".kernel", ".bias"))
    ]
    chosen = weights if chance.random() < 0.25 else [chance.choice(weights)]
    share, kind = chance.choice([1.0, 0.5, 0.1, 0.0]), chance.choice(["zero", "NaN", "random"])
    generator = np.random.default_rng(chance.randrange(2**32))
    for each in chosen:
        values = numpy_helper.to_array(each).copy()
        wrong = generator.random(values.shape) < share
        wrong.flat[generator.integers(values.size)] = True  # at least one of them
        replaced = {"zero": 0.0, "NaN": math.nan, "random": generator.normal(0, values.std() + 0.01, values.shape)}
        each.CopyFrom(numpy_helper.from_array(np.where(wrong, replaced[kind], values).astype(values.dtype), each.name))
    return sealed_again(model, networks), f"{key}: {len(chosen)} tensors, share {share}, {kind}"


def answers(model):
    """What a model finds in each picture of the demo: arrays of numbers without units."""
    detector = Detector(model)
    for path in sorted(DEMO.glob("image*.jpg")):
        camera = read_lens_file(DEMO / path.name.replace("image", "lens").replace(".jpg", ".yaml"))
        found = detector.detect(cv2.imread(str(path)), camera.orientation, camera.lens)
        objects = [[each.confidence, *each.bearing, *np.log([each.distance, each.angular_radius])] for each in found]
        field = found.field
        features = [] if field is None else [len(field.posts), len(field.robots), len(field.lines)]
        yield np.array(objects), np.array(features), found.probabilities


def changes_an_answer(model, before):
    """Whether an answer on the demo is different by more than LARGEST_CHANGE. NaN is different."""
    for new, old in zip(answers(model), before, strict=True):
        for one, other in zip(new, old, strict=True):
            if one.shape != other.shape or not np.abs(one - other).max(initial=0.0) <= LARGEST_CHANGE:
                return True
    return False


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("count", [150, pytest.param(2000, marks=pytest.mark.long)])
def test_attack_1_every_changed_bit_is_refused(name, count):
    whole, chance = model_path(name).read_bytes(), random.Random(1)
    for _ in range(count):
        content = bytearray(whole)
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        with pytest.raises(ModelError):
            parse_model("model.onnx", bytes(content))
    assert parse_model("model.onnx", whole).content == whole


def refused(name, seed, count, keys=None):
    """How many of `count` models with wrong weights are refused. The others must change no answer."""
    whole, chance, found = model_path(name).read_bytes(), random.Random(seed), 0
    before = list(answers(parse_model("model.onnx", whole)))
    for _ in range(count):
        content, what = corrupted(whole, chance, keys)
        model = parse_model("model.onnx", content)
        try:
            prove(model)
        except ModelError:
            found += 1
        else:
            assert not changes_an_answer(model, before), what
    return found


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.long)])
def test_attack_1_wrong_weights_under_a_right_checksum_are_refused(name, count):
    whole = model_path(name).read_bytes()
    prove(parse_model("model.onnx", sealed_again(*networks_of(whole))))  # with the right weights it is accepted
    assert refused(name, 2, count) > 0.9 * count


@pytest.mark.parametrize("count", [6, pytest.param(60, marks=pytest.mark.long)])
def test_attack_1_wrong_weights_of_a_look_at_several_classes_are_refused(count):
    assert refused("soccer", 3, count, [LOOK_KEY]) > 0.8 * count


@pytest.mark.parametrize("name", SHIPPED)
def test_the_self_tests_have_clear_positives_and_negatives_of_every_class(name):
    manifest = parse_model("model.onnx", model_path(name).read_bytes()).manifest
    probabilities = manifest.self_test.probabilities[:-1, : len(manifest.classes)]
    assert (probabilities.max(axis=0) > 0.7).all()
    assert (probabilities.min(axis=0) < 0.05).all()
    found = manifest.look.self_test.answers[..., 0]
    assert (found.max(axis=0) > 0.65).all()
    assert (found.min(axis=0) < 0.05).all()
    assert ((found > 0.05) & (found < 0.65)).any(axis=0).all()
