"""A model file must prove that it works before it is used."""

from dataclasses import replace

import numpy as np
import pytest

from tests.fixtures.make_drawn import FOLDER
from vm_embedded.errors import ModelError
from vm_embedded.live.proof import prove
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.network.example import SelfTest
from vm_embedded.network.look_example import LookTest
from vm_embedded.network.model_file import read_model

pytest.importorskip("onnxruntime")


@pytest.fixture(scope="module")
def ball():
    return read_model(model_path("ball"))


def test_the_proof_says_what_was_found(ball):
    assert prove(ball).startswith("self-test passed, canary found (1 ball, ")


def test_without_a_canary_the_self_tests_are_the_proof(ball):
    assert prove(replace(ball, canary=None)) == "self-test passed, no canary"


@pytest.mark.parametrize("empty", [False, True], ids=["none", "empty"])
@pytest.mark.parametrize("part", ["mesh network", "close look"])
@pytest.mark.parametrize("name", SHIPPED)
def test_a_model_without_a_self_test_is_refused(name, part, empty):
    model = read_model(model_path(name))
    manifest = model.manifest
    look, test = manifest.look, manifest.self_test
    no_points = SelfTest(test.points[-1:], np.zeros_like(test.neighbors[-1:]), test.probabilities[-1:])
    no_patches = LookTest(look.self_test.patches[:0], look.self_test.answers[:0])
    without = {
        "mesh network": replace(manifest, self_test=no_points if empty else None),
        "close look": replace(manifest, look=replace(look, self_test=no_patches if empty else None)),
    }
    with pytest.raises(ModelError, match=f"its {part} has no self-test"):
        prove(replace(model, manifest=without[part]))


def wrong(canary, **changes):
    """The canary with another first object."""
    first, *rest = canary.objects
    return replace(canary, objects=(replace(first, **changes), *rest))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda canary: replace(canary, picture=b"no picture"), "can't be searched"),
        (lambda canary: replace(canary, picture=canary.picture[:5000]), "can't be searched"),
        (lambda canary: replace(canary, lens="projection: ["), "can't be searched"),
        (lambda canary: replace(canary, lens=canary.lens[: canary.lens.index("Hoc")]), "needs Hoc"),
        (lambda canary: wrong(canary, center=(5.0, 5.0)), r"no ball at \(5, 5\) px"),
        (lambda canary: wrong(canary, radius=2.0 * canary.objects[0].radius), "no ball at"),
        (lambda canary: wrong(canary, class_name="cup"), "no cup at"),
        (lambda canary: replace(canary, objects=()), "a ball at .* where the exporter saw none"),
        (lambda canary: replace(canary, points={"ball": 1}), "points of the classes"),
        (lambda canary: replace(canary, points=canary.points | {"ball": 500}), "points of class ball instead of 500"),
    ],
)
def test_a_model_that_does_not_find_its_canary_is_refused(ball, change, complaint):
    with pytest.raises(ModelError, match=complaint):
        prove(replace(ball, canary=change(ball.canary)))


def test_the_drawn_network_has_its_self_test():
    assert prove(read_model(FOLDER / "ball.onnx")) == "self-test passed, no canary"
