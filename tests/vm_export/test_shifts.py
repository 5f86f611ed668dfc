"""Networks with and without shifts: the other answers stay, and a model file keeps its looks and its canary."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.vm_export.checkpoints import checkpoint
from vm_embedded.errors import ModelError
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
from vm_export.change_model import change_shifts
from vm_export.checkpoint import Checkpoint
from vm_export.cli import main
from vm_export.export import export, random_example
from vm_export.network_shape import Layer, NetworkShape
from vm_export.network_weights import network_of
from vm_export.reference import Overrides, read_reference, write_reference
from vm_export.shifts import with_shifts, without_shifts

LAST = {"convolution": 7 * 4, "separable": 4, "dense": 4}
"""Values that a last layer of each kind takes of a point, behind four channels."""


def made(kind="convolution"):
    """A network with the classes class0, of objects, and class1."""
    return checkpoint(5, NetworkShape((Layer("convolution", 4, "elu"), Layer(kind, 2, "softmax"))))


def answers(network, test):
    with torch.inference_mode():
        return network(torch.from_numpy(test.points), torch.from_numpy(test.neighbors)).numpy()


def weights_for(kind="convolution"):
    return np.random.default_rng(1).normal(0.0, 0.3, (LAST[kind] + 1, 2))


@pytest.mark.parametrize("kind", sorted(LAST))
def test_shifts_are_the_weighted_fields_and_all_else_stays(kind):
    bare, weights = made(kind), weights_for(kind)
    shifted = with_shifts(bare, "class0", weights)
    test = random_example(bare.network, 200, 3)
    found = answers(shifted.network, test)
    with torch.inference_mode():
        fields = bare.network.fields(torch.from_numpy(test.points), torch.from_numpy(test.neighbors)).numpy()
    np.testing.assert_allclose(found[:, :2], test.probabilities, atol=1e-6)
    np.testing.assert_allclose(found[:, 2:], fields @ weights[:-1] + weights[-1], atol=1e-5)
    np.testing.assert_array_equal(answers(without_shifts(shifted).network, test), answers(bare.network, test))
    again = with_shifts(shifted, "class0", 2.0 * weights)
    np.testing.assert_allclose(answers(again.network, test)[:, 2:], 2.0 * found[:, 2:], atol=1e-5)
    assert shifted.network.shape.operations == bare.network.shape.operations + 4 * LAST[kind]


def test_shifts_survive_a_checkpoint(tmp_path):
    shifted = with_shifts(made(), "class0", weights_for())
    shifted.save(tmp_path / "network.pt")
    read = Checkpoint.load(tmp_path / "network.pt")
    assert (read.manifest, read.network.shape) == (shifted.manifest, shifted.network.shape)
    test = random_example(shifted.network, 50, 3)
    np.testing.assert_array_equal(answers(read.network, test), test.probabilities)


def test_network_and_manifest_must_agree_about_shifts():
    with pytest.raises(ModelError, match="the network has no shifts, but the manifest has them for class class0"):
        replace(made(), manifest=replace(made().manifest, shifts="class0"))
    with pytest.raises(ModelError, match=r"class of kind object, of .'class0'., not 'class1'"):
        with_shifts(made(), "class1", weights_for())


@pytest.mark.parametrize("name", ["ball-small", "soccer"])
def test_a_model_file_with_new_shifts_keeps_its_other_answers_its_looks_and_its_canary(name, tmp_path):
    shipped = read_model(model_path(name))
    bare = without_shifts(network_of(shipped))
    fields = bare.network.typed_layers[-1].linear.in_features
    weights = np.random.default_rng(2).normal(0.0, 0.1, (fields + 1, 2))
    path = tmp_path / "shifted.onnx"
    assert not change_shifts(model_path(name), path, with_shifts(bare, "ball", weights))
    found = read_model(path)
    assert found.manifest.shifts == "ball"
    assert (found.look, found.upright_looks) == (shipped.look, shipped.upright_looks)
    looks = [each.as_dict() for each in shipped.manifest.looks]
    assert [each.as_dict() for each in found.manifest.looks] == looks
    assert found.canary.picture == shipped.canary.picture
    test, classes = found.manifest.self_test, len(shipped.manifest.classes)
    expected = Session(shipped).answer(test)[:, :classes]
    np.testing.assert_allclose(Session(found).answer(test)[:, :classes], expected, atol=2e-5)

    assert not change_shifts(path, path, without_shifts(network_of(found)))
    assert read_model(path).manifest.shifts is None


def test_the_reference_format_leaves_shifts_out(tmp_path):
    facts = {"sampling": "bilinear", "colors": "absolute"}
    bare = replace(made(), manifest=replace(made().manifest, **facts))
    for name, each in (("bare", bare), ("shifted", with_shifts(bare, "class0", weights_for()))):
        write_reference(each, tmp_path / f"{name}.yaml")
    assert (tmp_path / "bare.yaml").read_bytes() == (tmp_path / "shifted.yaml").read_bytes()
    classes = Overrides(classes=bare.manifest.classes, max_distance=10.0)
    assert read_reference(tmp_path / "shifted.yaml", classes).manifest.shifts is None


def test_renamed_classes_take_their_shifts_along(tmp_path, capsys):
    with_shifts(made(), "class0", weights_for()).save(tmp_path / "network.pt")
    assert main([str(tmp_path / "network.pt"), "--classes", "cup:object,table:background"]) == 0
    assert read_model(tmp_path / "network.onnx").manifest.shifts == "cup"
    assert "shifts to the class cup" in capsys.readouterr().out
    assert main([str(tmp_path / "network.pt"), "--classes", "table:background,cup:object"]) == 1
    assert "shifts in the model's manifest must be a class of kind object" in capsys.readouterr().err


def test_a_file_with_too_few_outputs_for_its_shifts_is_refused(tmp_path):
    export(with_shifts(made(), "class0", weights_for()), tmp_path / "network.onnx")
    read = read_model(tmp_path / "network.onnx")
    assert Session(read).model.manifest.outputs == 4
    with pytest.raises(ModelError, match="probabilities"):
        Session(replace(read, manifest=replace(read.manifest, shifts=None, self_test=None)))
