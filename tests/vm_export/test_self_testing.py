"""The self-test of a mesh network shows when its weights are different."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fixtures.make_drawn import FOLDER
from tests.vm_export.checkpoints import checkpoint
from vm_embedded.errors import ModelError
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
from vm_export import export
from vm_export.network_weights import network_of
from vm_export.self_testing import strong_self_test

pytest.importorskip("onnxruntime")


def test_the_network_is_sure_of_each_class_and_unsure_between_classes():
    made = network_of(read_model(FOLDER / "ball.onnx"))
    found = strong_self_test(made.network, made.manifest).probabilities[:-1]
    assert (found.max(axis=0) > 0.9).all()
    assert (found.min(axis=0) < 0.1).all()
    assert (np.abs(found - 0.5) < 0.2).any(axis=0).all()


@pytest.mark.long
@pytest.mark.parametrize("mesh", ["ring4", "ring8", "xygrid6", "cap6", "octaves"])
def test_a_model_file_with_another_weight_is_refused(mesh, tmp_path):
    right = checkpoint(1, mesh=mesh)
    export.export(right, tmp_path / "model.onnx")
    read = read_model(tmp_path / "model.onnx")
    Session(read)
    wrong = checkpoint(1, mesh=mesh).network
    with torch.no_grad():
        (wrong.stem if mesh == "octaves" else wrong.layers[0].linear).weight[0, 0] += 0.1
    content = export.onnx_model(wrong, read.manifest)
    with pytest.raises(ModelError, match="self-test failed"):
        Session(replace(read, content=content))
