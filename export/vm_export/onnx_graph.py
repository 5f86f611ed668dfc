"""From a torch network to one self-describing ONNX file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import TensorProto, helper, numpy_helper

import vm_embedded
from vm_embedded.arrays import Indices, Singles
from vm_embedded.errors import ModelError
from vm_embedded.files import written_beside
from vm_embedded.manifest import METADATA_KEY, Manifest, SelfTest

from .checkpoint import Checkpoint
from .network import Dense, GraphConvolution, Network, SeparableConvolution

_OPSET = 17
_IR_VERSION = 8
"""What ONNX Runtime has read since 1.12: a robot's may be older than the workstation's."""

_OPERATORS = {"selu": "Selu", "relu": "Relu", "elu": "Elu", "tanh": "Tanh", "softmax": "Softmax", "sigmoid": "Sigmoid"}

LARGEST_DIFFERENCE = 1e-4
"""Probability by which ONNX Runtime may differ from torch."""

_CHECKED_POINTS = (1, 2, 7, 64, 1000, 5000)


def build(network: Network, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model of the network: stock operators, weights inside, the neighbor indices an input.

    Inputs: points (n + 1, 3) float32 and neighbors (n + 1, N) int32, where row n is the off-screen point. Output:
    probabilities (n + 1, C) float32.
    """
    nodes: list[onnx.NodeProto] = []
    weights: list[onnx.TensorProto] = []

    def constant(name: str, value: np.ndarray) -> str:
        weights.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def node(operator: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output

    x = "points"
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.layers, strict=True)):
        name = f"layer{index}"
        assert isinstance(layer, GraphConvolution | SeparableConvolution | Dense)
        linear = layer.linear
        if not isinstance(layer, Dense):
            gathered = node("Gather", [x, "neighbors"], f"{name}.gathered", axis=0)
        if isinstance(layer, GraphConvolution):
            width = linear.in_features * network.shape.neighbors // (network.shape.neighbors + 1)
            shape = constant(f"{name}.shape", np.array([-1, width], dtype=np.int64))
            flat = node("Reshape", [gathered, shape], f"{name}.flat")
            x = node("Concat", [x, flat], f"{name}.receptive", axis=1)
        elif isinstance(layer, SeparableConvolution):
            depthwise = layer.depthwise.detach().numpy()
            axis = constant(f"{name}.axis", np.array([1], dtype=np.int64))
            weighted = node("Mul", [gathered, constant(f"{name}.around", depthwise[1:])], f"{name}.weighted")
            summed = node("ReduceSum", [weighted, axis], f"{name}.summed", keepdims=0)
            itself = node("Mul", [x, constant(f"{name}.self", depthwise[0])], f"{name}.itself")
            x = node("Add", [summed, itself], f"{name}.receptive")
        kernel = constant(f"{name}.kernel", linear.weight.detach().numpy().T)
        bias = constant(f"{name}.bias", linear.bias.detach().numpy())
        x = node("Gemm", [x, kernel, bias], f"{name}.linear")
        last = index == len(network.shape.layers) - 1
        attributes = {"axis": 1} if spec.activation == "softmax" else {}
        output = "probabilities" if last else f"{name}.activation"
        x = node(_OPERATORS[spec.activation], [x], output, **attributes)

    graph = helper.make_graph(
        nodes,
        "visual_mesh",
        [
            helper.make_tensor_value_info("points", TensorProto.FLOAT, ["points_and_off_screen", 3]),
            helper.make_tensor_value_info(
                "neighbors", TensorProto.INT32, ["points_and_off_screen", network.shape.neighbors]
            ),
        ],
        [
            helper.make_tensor_value_info(
                "probabilities", TensorProto.FLOAT, ["points_and_off_screen", network.shape.classes]
            )
        ],
        weights,
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        producer_name="vm-export",
        doc_string="Visual Mesh network. Row n of points and neighbors is the off-screen point: -1, linked to itself.",
    )
    helper.set_model_props(model, {METADATA_KEY: manifest.as_json()})
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def export(checkpoint: Checkpoint, path: str | Path) -> float:
    """Write the model file of a checkpoint and return the largest difference to torch.

    The file is checked in ONNX Runtime before it is written. Raises ModelError if a probability differs by more than
    LARGEST_DIFFERENCE, InputError if the file can't be written.
    """
    network = checkpoint.network.eval()
    test = _example(network, points=12, seed=0)
    provenance = {**checkpoint.manifest.provenance, "exported_by": f"vm-export {vm_embedded.__version__}"}
    content = build(network, replace(checkpoint.manifest, self_test=test, provenance=provenance))
    difference = largest_difference(content, network)
    if not difference <= LARGEST_DIFFERENCE:
        raise ModelError(
            f"not written: ONNX Runtime and torch differ by {difference:.2g}, allowed are {LARGEST_DIFFERENCE:g}"
        )
    with written_beside(Path(path)) as part:
        part.write_bytes(content)
    return difference


def largest_difference(content: bytes, network: Network) -> float:
    """Largest difference of a probability between ONNX Runtime and torch, over several numbers of points."""
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    worst = 0.0
    for seed, points in enumerate(_CHECKED_POINTS):
        test = _example(network, points, seed)
        (answer,) = session.run(["probabilities"], {"points": test.points, "neighbors": test.neighbors})
        worst = max(worst, float(np.abs(answer - test.probabilities).max()))
    return worst


def _example(network: Network, points: int, seed: int) -> SelfTest:
    """Random colors on a random graph of `points` points, rounded as the manifest does, and torch's answer."""
    random = np.random.default_rng(seed)
    colors: Singles = np.full((points + 1, 3), -1.0, dtype=np.float32)
    colors[:-1] = np.round(random.random((points, 3)), 4)
    neighbors: Indices = random.integers(0, points + 1, (points + 1, network.shape.neighbors)).astype(np.int32)
    neighbors[-1] = points
    with torch.inference_mode():
        answer = network(torch.from_numpy(colors), torch.from_numpy(neighbors)).numpy()
    return SelfTest(colors, neighbors, answer)
