"""An ONNX model in ONNX Runtime: loading, threads, errors. The only module that imports onnxruntime."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

# Builds from 1.29 on send telemetry and keep an identifier on disk, unless it is disabled before they are loaded.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as states

from ..arrays import Singles
from ..errors import ModelError, one_line
from .layout import Feeds

RUNTIME_VERSION: str = onnxruntime.__version__

Interface = dict[str, tuple[str, list[int]]]
"""Type and fixed sizes of each input and output, by name."""

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

_SELF_TEST_TOLERANCE = 1e-4
"""A hundred times the rounding of single precision, in which processors differ, and far below a change of an answer."""


class _InferenceSession(onnxruntime.InferenceSession):  # type: ignore[misc]
    """A session that does not try again after an error.

    ONNX Runtime would first print to standard output, among the messages. Its own switch, `enable_fallback`, does not
    exist before 1.18. Nor can standard output be redirected meanwhile: all threads of the program share it.
    """

    _enable_fallback = property(lambda self: False, lambda self, value: None)


def usable_threads(threads: int) -> int:
    """A number of threads, but at most the cores that this process may use."""
    return min(threads, len(os.sched_getaffinity(0)))


class OnnxModel:
    """A model with one output, loaded by ONNX Runtime on the CPU.

    path: only for messages. content: the bytes of the file. interface: the inputs and outputs that the model must have.
    threads: never more than this process may use. spinning: idle threads spin instead of sleeping, and take whole cores
    from other programs. Raises ModelError if the model does not load or has another interface.
    """

    def __init__(
        self, path: str | Path, content: bytes, interface: Interface, output: str, threads: int, spinning: bool
    ) -> None:
        self.path = path
        self.threads = usable_threads(threads)
        self._outputs = [output]
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = self.threads
        options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        # The number of points changes with every frame, so remembered memory patterns would only accumulate.
        options.enable_mem_pattern = False
        options.log_severity_level = 4
        # A file may also be in ONNX Runtime's own format; without this, it would run as a network that nobody checked.
        options.add_session_config_entry("session.load_model_format", "ONNX")
        options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
        try:
            self._session = _InferenceSession(content, options, providers=["CPUExecutionProvider"])
            found = {
                node.name: (node.type, [size for size in node.shape if isinstance(size, int)])
                for node in (*self._session.get_inputs(), *self._session.get_outputs())
            }
        except _RUNTIME_ERRORS as error:
            raise ModelError(f"{path}: ONNX Runtime can't load it: {one_line(error)}") from error
        if found != interface:
            raise ModelError(f"{path}: its inputs and outputs are {found}, its manifest asks for {interface}")

    def run(self, feeds: Feeds) -> Singles:
        """The output for inputs by name. Raises ModelError."""
        try:
            outputs = self._session.run(self._outputs, feeds)
        except _RUNTIME_ERRORS as error:
            raise ModelError(f"{self.path}: ONNX Runtime can't run it: {one_line(error)}") from error
        return np.asarray(outputs[0])

    def check_answer(
        self, answer: Singles, expected: npt.NDArray[np.floating], tolerance: float = _SELF_TEST_TOLERANCE
    ) -> None:
        """Compare the answer to a self-test with the one that the exporter saw.

        Raises ModelError if they differ by more than `tolerance`.
        """
        if answer.shape != expected.shape:
            raise ModelError(f"{self.path}: self-test answered in shape {answer.shape}, not {expected.shape}")
        error = float(np.abs(answer - expected).max(initial=0.0))
        if not error <= tolerance:
            raise ModelError(f"{self.path}: self-test failed, answers are off by {error:.2g}")
