"""Calibrated peaks: only the scores of a class change, in a file that still proves itself."""

import numpy as np
import pytest

from tests.vm_export.checkpoints import checkpoint
from vm_embedded.network.manifest import PEAK_OUTPUTS
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
from vm_export import export
from vm_export.canvas_shape import CanvasShape
from vm_export.change_model import change_confidence


@pytest.mark.long
@pytest.mark.parametrize("changes", [{"class1": (2.0, 0.5)}, {"class0": (0.3, -1.0), "class1": (1.0, 4.0)}])
def test_only_the_scores_of_a_class_change(changes, tmp_path):
    export.export(checkpoint(4, CanvasShape(1, 8, 3, 2), "octaves"), tmp_path / "model.onnx")
    assert not change_confidence(tmp_path / "model.onnx", tmp_path / "other.onnx", [], changes)
    old, new = (read_model(tmp_path / f"{name}.onnx") for name in ("model", "other"))
    assert new.manifest.peaks == old.manifest.peaks == ("class0", "class1")
    test = new.manifest.self_test  # which the session checks
    before, after = (Session(each).answer(test) for each in (old, new))
    for name, (scale, offset) in changes.items():
        column = 3 + PEAK_OUTPUTS * old.manifest.peaks.index(name)
        np.testing.assert_allclose(after[:, column], scale * before[:, column] + offset, atol=1e-4)
        after[:, column] = before[:, column]
    np.testing.assert_allclose(after, before, atol=1e-5)
