"""The look network of a model file, ready to run. It judges each proposal of the mesh network."""

from __future__ import annotations

import numpy as np

from ..arrays import Image, Singles
from ..errors import ModelError
from .look_contract import ANSWERS
from .model_file import ModelFile
from .onnx_model import OnnxModel


class CloseLook:
    """A loaded look network.

    threads, spinning: see OnnxModel. Loading runs the self-test. Raises ModelError if the model file has no look
    network, or if it does not load, has other inputs and outputs than its manifest says, or fails the self-test.
    """

    def __init__(self, model: ModelFile, threads: int = 1, spinning: bool = False) -> None:
        if model.manifest.look is None or model.look is None:
            raise ModelError(f"{model.path}: has no close look")
        self.contract = model.manifest.look
        size = self.contract.size
        interface = {"patches": ("tensor(uint8)", [size, size, 3]), "answers": ("tensor(float)", [len(ANSWERS)])}
        name = f"{model.path}, close look"
        self.onnx = OnnxModel(name, model.look, interface, "answers", threads, spinning)
        test = self.contract.self_test
        if test is not None:
            self.onnx.check_answer(self.run(test.patches), test.answers)

    def run(self, patches: Image) -> Singles:
        """Answers (n, 4) to patches (n, size, size, 3), RGB. Raises ModelError, also for answers that are not finite.

        A row holds the calibrated probability that an object is in the middle, the shift of its center to the right
        and down [expected radii], and the logarithm of its apparent radius over the expected one.
        """
        if not len(patches):
            return np.empty((0, len(ANSWERS)), dtype=np.float32)
        answers = self.onnx.run({"patches": patches})
        if not np.isfinite(answers).all():
            raise ModelError(f"{self.onnx.path}: its answers are NaN or infinite")
        return answers
