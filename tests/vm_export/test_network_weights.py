"""The mesh network of a model file is read back: the same answers."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.vm_export.checkpoints import checkpoint
from tests.vm_export.test_export import any_checkpoint, in_all_layouts
from vm_embedded.errors import ModelError
from vm_embedded.network.bundled import SHIPPED, model_path
from vm_embedded.network.model_file import ModelFile, read_model
from vm_export import export
from vm_export.checkpoint import Checkpoint
from vm_export.network_shape import NetworkShape
from vm_export.network_weights import network_of


@in_all_layouts
@given(data=st.data(), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_every_network_comes_back_from_its_model_file(on_canvas, data, seed):
    made = any_checkpoint(data.draw, on_canvas, seed)
    facts = made.manifest
    model = ModelFile(Path("model.onnx"), export.onnx_model(made.network, facts), facts, "")
    read = network_of(model)
    test = export.random_example(made.network, 200, seed)
    around = test.cells if on_canvas else test.neighbors
    with torch.inference_mode():
        answer = read.network.probabilities(torch.from_numpy(test.points), torch.from_numpy(around)).numpy()
    np.testing.assert_allclose(answer, test.probabilities, atol=2e-5)
    assert read.network.shape == made.network.shape
    again = ModelFile(Path("again.onnx"), export.onnx_model(read.network, facts), facts, "")
    assert export.largest_difference(again.content, made.network, facts) < 1e-4


@pytest.mark.parametrize("name", SHIPPED)
def test_the_networks_of_the_package_come_back_and_are_exported_again(name, tmp_path):
    shipped = read_model(model_path(name))
    read = network_of(shipped)
    export.export(read, tmp_path / "again.onnx")
    again = read_model(tmp_path / "again.onnx")
    assert export.largest_difference(again.content, network_of(shipped).network, again.manifest) < 1e-5
    for entry in ("classes", "any_radius", "sampling", "colors", "mesh", "intersections"):
        assert getattr(again.manifest, entry) == getattr(shipped.manifest, entry)
    read.save(tmp_path / "network.pt")
    assert Checkpoint.load(tmp_path / "network.pt").network.shape == read.network.shape


def write_changed(path, change):
    """A model file that a change of its graph makes another one's."""
    made = checkpoint(1, NetworkShape.uniform(3, 4, 2, activation="elu"))
    model = onnx.load_from_string(export.onnx_model(made.network, made.manifest))
    change(model.graph)
    return ModelFile(path, model.SerializeToString(), made.manifest, "")


def rename_kernels(graph):
    for each in graph.initializer:
        if each.name.endswith(".kernel"):
            new = each.name.replace("layer", "block")
            for node in graph.node:
                node.input[:] = [new if name == each.name else name for name in node.input]
            each.name = new


def change_an_activation(graph):
    node = next(each for each in graph.node if each.op_type == "Elu")
    node.op_type = "Abs"


@pytest.mark.parametrize("change", [rename_kernels, change_an_activation])
def test_a_graph_of_another_program_is_refused(change, tmp_path):
    with pytest.raises(ModelError, match=r"model\.onnx: its mesh network has other layers than vm-export writes"):
        network_of(write_changed(tmp_path / "model.onnx", change))
