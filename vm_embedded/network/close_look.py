"""The look network of a model file, ready to run. It judges each peak of the mesh network."""

from __future__ import annotations

import numpy as np

from ..arrays import Image, Singles
from ..errors import ModelError
from .look_contract import LookContract
from .look_example import ANSWERS
from .model_file import ModelFile
from .onnx_model import OnnxModel

_TOLERANCE = 2e-5
"""Of a self-test. Processors differ by a twentieth of it."""


class CloseLook:
    """A loaded look network.

    name: for messages. content: its ONNX file. threads, spinning: see OnnxModel. Loading runs the self-test. Raises
    ModelError if it does not load, has other inputs and outputs than its contract says, or fails the self-test.
    """

    def __init__(
        self, name: str, contract: LookContract, content: bytes, threads: int = 1, spinning: bool = False
    ) -> None:
        self.contract = contract
        size = contract.size
        self._shape = len(contract.classes), len(ANSWERS)
        interface = {"patches": ("tensor(uint8)", [size, size, 3]), "answers": ("tensor(float)", [*self._shape])}
        self.onnx = OnnxModel(name, content, interface, "answers", threads, spinning)
        test = contract.self_test
        if test is not None:
            self.onnx.check_answer(self.run(test.all_patches), test.answers, _TOLERANCE)

    @classmethod
    def of(cls, model: ModelFile, threads: int = 1, spinning: bool = False) -> CloseLook | None:
        """The look network of a model file, None without one. Raises ModelError."""
        contract = model.manifest.look
        if contract is None:
            return None
        return cls(f"{model.path}, close look", contract, model.look, threads, spinning)

    def run(self, patches: Image) -> Singles:
        """Answers (n, C, 4) to patches (n, size, size, 3), RGB. Raises ModelError, also for NaN and infinite answers.

        For each class of the contract, they are the calibrated probability that an object is in the middle, the shift
        of its center to the right and down [expected radii], and the logarithm of its apparent radius over the expected
        one.
        """
        if not len(patches):
            return np.empty((0, *self._shape), dtype=np.float32)
        answers = self.onnx.run({"patches": patches})
        if not np.isfinite(answers).all():
            raise ModelError(f"{self.onnx.path}: its answers are NaN or infinite")
        return answers
