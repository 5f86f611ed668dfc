"""The look network of a model file, ready to run. It judges each proposal of the mesh network.

A smaller network, the glance, may judge the proposals first. Most of them are so clearly nothing that it can tell, and
the look network has time for the rest. The glance may have a glance, too.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Image, Singles
from ..errors import ModelError
from .look_contract import LookContract
from .look_test import ANSWERS
from .model_file import LookFiles, ModelFile
from .onnx_model import OnnxModel

_TOLERANCE = 2e-5
"""Of a self-test. Processors differ by a twentieth of it, and a place that passes the glance by a hair by more."""


class CloseLook:
    """A loaded look network, and its glance, if it has one.

    name: for messages. content: its ONNX file. threads, spinning: see OnnxModel. Loading runs the self-test. Raises
    ModelError if it does not load, has other inputs and outputs than its contract says, or fails the self-test.
    """

    def __init__(
        self,
        name: str,
        contract: LookContract,
        content: bytes,
        glance: CloseLook | None = None,
        threads: int = 1,
        spinning: bool = False,
    ) -> None:
        self.contract, self.glance = contract, glance
        size = contract.size
        interface = {"patches": ("tensor(uint8)", [size, size, 3]), "answers": ("tensor(float)", [len(ANSWERS)])}
        self.onnx = OnnxModel(name, content, interface, "answers", threads, spinning)
        test = contract.self_test
        if test is not None:
            self.onnx.check_answer(self.run(test.all_patches), test.answers, _TOLERANCE)

    @classmethod
    def of(cls, model: ModelFile, threads: int = 1, spinning: bool = False) -> CloseLook | None:
        """The look network of a model file at objects, None if it has none. Raises ModelError."""
        contract, files = model.manifest.look, model.look
        if contract is None or files is None:
            return None
        return cls._chain(f"{model.path}, ", contract, files, threads, spinning)

    @classmethod
    def of_uprights(cls, model: ModelFile, threads: int = 1, spinning: bool = False) -> dict[str, CloseLook]:
        """The look networks of a model file for classes of kind upright, by class. Raises ModelError."""
        return {
            each.object_class: cls._chain(f"{model.path}, {each.object_class}: ", each, files, threads, spinning)
            for each, files in zip(model.manifest.upright_looks, model.upright_looks, strict=True)
        }

    @classmethod
    def _chain(cls, prefix: str, contract: LookContract, files: LookFiles, threads: int, spinning: bool) -> CloseLook:
        """A look network with its glances. prefix: of their names in messages."""
        made: CloseLook | None = None
        for name, part, file in reversed(list(zip(contract.names, contract.chain, files, strict=True))):
            made = cls(f"{prefix}{name}", part, file, made, threads, spinning)
        assert made is not None  # a chain has at least one network
        return made

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
