"""The network, run by ONNX Runtime: the only place that imports it."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

# Builds from 1.29 on report to their makers over the network, and keep an identifier on disk, unless told not to before
# they are loaded.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as states

from ..arrays import Mask, Singles
from ..detection.settings import Settings
from ..errors import ModelError, one_line
from ..mesh.mesh import Mesh
from .choose_layout import choose_layout
from .layout import Layout
from .manifest import SelfTest
from .model_file import ModelFile

RUNTIME_VERSION: str = onnxruntime.__version__

_RUNTIME_ERRORS = (
    states.EPFail,
    states.Fail,
    states.InvalidArgument,
    states.InvalidGraph,
    states.InvalidProtobuf,
    states.ModelLoaded,
    states.NoModel,
    states.NotImplemented,
    states.RuntimeException,
    RuntimeError,
    ValueError,
)

_SELF_TEST_TOLERANCE = 1e-3
"""Far above what processors differ by, far below what changes an answer."""


class Session:
    """A loaded network.

    Threads are set explicitly, never more than this process may use, and do not spin unless told to: the robot has
    other work for its cores. Loading runs the model's self-test. Raises ModelError if the file does not load, has
    other inputs and outputs than its manifest says, or answers its self-test wrongly.
    """

    def __init__(self, model: ModelFile, settings: Settings) -> None:
        self.model = model
        options = onnxruntime.SessionOptions()
        self.threads = min(settings.threads, len(os.sched_getaffinity(0)))
        options.intra_op_num_threads = self.threads
        options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        # The number of points changes with every frame: remembered memory patterns would only pile up.
        options.enable_mem_pattern = False
        options.log_severity_level = 4
        options.add_session_config_entry("session.intra_op.allow_spinning", "1" if settings.spinning else "0")
        try:
            self._session = onnxruntime.InferenceSession(model.content, options, providers=["CPUExecutionProvider"])
        except _RUNTIME_ERRORS as error:
            raise ModelError(f"{model.path}: ONNX Runtime can't load it: {one_line(error)}") from error
        self._check_interface()
        self.self_test()

    def run(self, layout: Layout, points: Singles, on_screen: Mask) -> Singles:
        """Probabilities (m, C) of a layout's slots, from its `points`, colored, and those (m,) that are on screen."""
        try:
            outputs = self._session.run(["probabilities"], layout.feeds(points, on_screen))
        except _RUNTIME_ERRORS as error:
            raise ModelError(f"{self.model.path}: ONNX Runtime can't run it: {one_line(error)}") from error
        return layout.answers(np.asarray(outputs[0]))

    def answer(self, test: SelfTest) -> Singles:
        """Probabilities (n, C) of an example's points."""
        mesh = Mesh(np.zeros((len(test.points) - 1, 3)), test.neighbors, test.cells)
        # The example's missing neighbors are the off-screen point, whatever the network was trained with.
        layout = choose_layout(mesh, replace(self.model.manifest, edge="hard"))
        points = layout.points()
        layout.colors(points)[:] = test.points[layout.slots]
        return self.run(layout, points, layout.slots < len(mesh))[layout.places]

    def self_test(self) -> None:
        """Run the model's own example. Raises ModelError if the answer is not the one that the exporter saw."""
        test = self.model.manifest.self_test
        if test is None:
            return
        if test.neighbors.shape[1] != self.model.manifest.neighbors:
            raise ModelError(f"{self.model.path}: self-test is for {test.neighbors.shape[1]} neighbors a point")
        if self.model.manifest.layout == "lattice" and test.cells is None:
            raise ModelError(f"{self.model.path}: self-test does not say where its points lie in the lattice")
        answer, expected = self.answer(test), test.probabilities[:-1]
        if answer.shape != expected.shape:
            raise ModelError(f"{self.model.path}: self-test answered in shape {answer.shape}")
        error = float(np.abs(answer - expected).max(initial=0.0))
        if not error <= _SELF_TEST_TOLERANCE:
            raise ModelError(f"{self.model.path}: self-test failed, probabilities are off by {error:.2g}")

    def _check_interface(self) -> None:
        manifest = self.model.manifest
        found = {
            node.name: (node.type, [size for size in node.shape if isinstance(size, int)])
            for node in (*self._session.get_inputs(), *self._session.get_outputs())
        }
        expected = {"points": ("tensor(float)", [3]), "probabilities": ("tensor(float)", [len(manifest.classes)])}
        if manifest.layout == "plain":
            expected["neighbors"] = ("tensor(int32)", [manifest.neighbors])
        elif manifest.layout == "runs":
            expected["columns"] = ("tensor(int64)", [len(manifest.model.runs)])
        else:
            expected["shown"] = ("tensor(bool)", [])
        if found != expected:
            raise ModelError(f"{self.model.path}: its inputs and outputs are {found}, its manifest asks for {expected}")
