"""The networks of a model file, ready to run: the mesh network, and the close look, which judges its peaks."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from ..arrays import Chosen, Image, Mask, Singles
from ..errors import ModelError
from ..mesh.mesh import Mesh
from .choose_layout import choose_layout
from .example import SelfTest
from .layout import Layout
from .look_contract import LookContract
from .look_example import ANSWERS
from .manifest import Manifest
from .model_file import ModelFile
from .onnx_model import Interface, OnnxModel

_LOOK_TOLERANCE = 2e-5
"""Of the self-test of a close look. Processors differ by a twentieth of it."""


class Session:
    """A loaded mesh network.

    threads: never more than this process may use; ONNX Runtime splits each operator. spinning: see OnnxModel. Loading
    runs the model's self-test. Raises ModelError if the file does not load, has other inputs and outputs than its
    manifest says, or fails its self-test.
    """

    def __init__(self, model: ModelFile, threads: int = 1, spinning: bool = False) -> None:
        self.model = model
        self._process = os.getpid()
        self.onnx = OnnxModel(model.path, model.content, _interface(model.manifest), "probabilities", threads, spinning)
        if model.manifest.self_test is not None:
            self._check(model.manifest.self_test)

    def run(self, layout: Layout, colors: Singles, on_screen: Mask, points: Chosen) -> Singles:
        """All outputs (k, outputs) for points (k,) on screen; see detection.observation.Classifier.

        Raises ModelError, also for answers that are not finite, and for several threads in a process that was forked
        after the model was loaded.
        """
        if self.onnx.threads > 1 and os.getpid() != self._process:  # it would wait forever: a fork has no other threads
            raise ModelError(
                f"{self.model.path}: its {self.onnx.threads} threads belong to another process; "
                "load the detector in each process, or use one thread"
            )
        answers = layout.read(self.onnx.run(layout.feeds(colors, on_screen)), points)
        if not np.isfinite(answers).all():
            raise ModelError(f"{self.model.path}: its answers are NaN or infinite")
        return answers

    def answer(self, test: SelfTest) -> Singles:
        """Answers (n, outputs) to an example's points."""
        mesh = Mesh(np.zeros((len(test.points) - 1, 3)), test.neighbors, test.cells)
        # In an example a missing neighbor is always the off-screen point, also for networks with another edge policy.
        layout = choose_layout(mesh, replace(self.model.manifest, edge="hard"))
        colors = np.stack([layout.spread(each) for each in test.points[:-1].T])
        return self.run(layout, colors, np.ones(len(mesh), dtype=bool), np.arange(len(mesh)))

    def _check(self, test: SelfTest) -> None:
        """Run the model's own example. Raises ModelError if the answer differs from the exporter's."""
        manifest = self.model.manifest
        if test.neighbors.shape[1] != manifest.neighbors:
            raise ModelError(
                f"{self.model.path}: self-test has {test.neighbors.shape[1]} neighbors for each point, "
                f"its mesh {manifest.mesh} has {manifest.neighbors}"
            )
        if manifest.on_canvas and test.cells is None:
            raise ModelError(f"{self.model.path}: self-test lacks the cells of its points on strips")
        self.onnx.check_answer(self.answer(test), test.probabilities[:-1])


def _interface(manifest: Manifest) -> Interface:
    """The inputs and outputs of a mesh network, on a canvas or on a graph."""
    outputs = manifest.outputs
    if manifest.on_canvas:
        return {
            "points": ("tensor(float)", [1, 3]),
            "shown": ("tensor(bool)", [1, 1]),
            "probabilities": ("tensor(float)", [1, outputs]),
        }
    return {
        "points": ("tensor(float)", [3]),
        "neighbors": ("tensor(int32)", [manifest.neighbors]),
        "probabilities": ("tensor(float)", [outputs]),
    }


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
            self.onnx.check_answer(self.run(test.all_patches), test.answers, _LOOK_TOLERANCE)

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
