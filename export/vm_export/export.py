"""From a checkpoint to a self-describing ONNX file, checked against torch."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import vm_embedded
from vm_embedded.arrays import Indices, Singles
from vm_embedded.errors import ModelError
from vm_embedded.files import write_file
from vm_embedded.mesh.grids import STEPS, lattice_neighbors
from vm_embedded.network.example import SelfTest
from vm_embedded.network.layout import OFF_SCREEN
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.model_file import ModelFile, parse_model
from vm_embedded.network.session import Session

from .attach_canary import CanaryPicture, with_canary
from .attach_look import attached
from .canvas_graph import canvas_model
from .canvas_network import CanvasNetwork
from .checkpoint import Checkpoint
from .look_checkpoint import LookCheckpoint
from .mesh_networks import MeshNetwork, model_outputs
from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution
from .onnx_graph import FLOAT, INT32, OnnxGraph
from .self_testing import strong_self_test

LARGEST_DIFFERENCE = 1e-4
"""Largest difference of an answer that is allowed between ONNX Runtime and torch."""

_CHECKED_POINTS = (1, 2, 7, 64, 1000, 5000)


def onnx_model(network: MeshNetwork, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model, of standard operators only."""
    return canvas_model(network, manifest) if isinstance(network, CanvasNetwork) else plain_model(network, manifest)


def export(
    checkpoint: Checkpoint,
    path: str | Path,
    look: LookCheckpoint | None = None,
    canary: CanaryPicture | None = None,
) -> float:
    """Write the model file of a checkpoint and return the largest difference to torch of an answer.

    look: network to write into the same file. canary: a picture that becomes its canary. ONNX Runtime runs the
    networks before the file is written. Raises ModelError if an answer differs by more than LARGEST_DIFFERENCE, or a
    look does not fit the classes, and InputError if the picture does not show every class, or the file can't be
    written.
    """
    network = checkpoint.network.eval()
    provenance = {**checkpoint.manifest.provenance, "exported_by": f"vm-export {vm_embedded.__version__}"}
    manifest = replace(
        checkpoint.manifest,
        look=None,
        operations=network.shape.operations,
        provenance=provenance,
    )
    manifest = replace(manifest, self_test=strong_self_test(network, manifest))
    content = onnx_model(network, manifest)
    difference = largest_difference(content, network, manifest)
    check_difference(path, "probabilities", difference)
    if look is not None:
        content, look_difference = with_look(path, content, look)
        difference = max(difference, look_difference)
    if canary is not None:
        content = with_canary(content, canary)
    write_file(Path(path), content)
    return difference


def with_look(path: str | Path, content: bytes, look: LookCheckpoint) -> tuple[bytes, float]:
    """A model file's bytes with this look network, and the largest difference to torch of its answers.

    path: of the file that is to be written. Raises ModelError if an answer differs by more than LARGEST_DIFFERENCE, or
    if the look judges no class that the file has peaks for.
    """
    content, difference = attached(content, parse_model(path, content).manifest, look)
    check_difference(path, "answers of the close look", difference)
    return content, difference


def check_difference(path: str | Path, what: str, difference: float) -> None:
    """Raises ModelError if ONNX Runtime and torch differ too much, or if an answer is NaN."""
    if not difference <= LARGEST_DIFFERENCE:
        raise ModelError(
            f"{path} is not written: {what} of ONNX Runtime and torch differ by {difference:.2g}; at most "
            f"{LARGEST_DIFFERENCE:g} is allowed"
        )


def largest_difference(content: bytes, network: MeshNetwork, manifest: Manifest) -> float:
    """The largest difference of a probability between ONNX Runtime and torch, for graphs of different sizes.

    NaN if a probability is NaN.
    """
    session = Session(ModelFile(Path("the new model"), content, replace(manifest, self_test=None), ""))
    tests = (random_example(network, points, seed) for seed, points in enumerate(_CHECKED_POINTS))
    return float(np.max([np.abs(session.answer(test) - test.probabilities[:-1]).max() for test in tests]))


def random_example(network: MeshNetwork, points: int, seed: int) -> SelfTest:
    """A random graph of `points` points with random colors, rounded as SelfTest.as_dict rounds, and torch's answer.

    For a network on a canvas: a random part of a strip.
    """
    random = np.random.default_rng(seed)
    colors: Singles = np.full((points + 1, 3), OFF_SCREEN, dtype=np.float32)
    colors[:-1] = np.round(random.random((points, 3)), 4)
    cells: Indices | None = None
    if isinstance(network, CanvasNetwork):
        side = math.ceil(math.sqrt(1.5 * points))
        chosen = np.sort(random.choice(side * side, points, replace=False))
        cells = np.stack([chosen % side, chosen // side], axis=1).astype(np.int32)
        neighbors = lattice_neighbors(cells, STEPS[8])  # as in mesh octaves
    else:
        neighbors = random.integers(0, points + 1, (points + 1, network.shape.neighbors)).astype(np.int32)
        neighbors[-1] = points
    around = neighbors if cells is None else cells
    with torch.inference_mode():
        answer = model_outputs(network, torch.from_numpy(colors), torch.from_numpy(around)).numpy()
    return SelfTest(colors, neighbors, answer, cells)


_OPERATORS = {"selu": "Selu", "relu": "Relu", "elu": "Elu", "tanh": "Tanh", "softmax": "Softmax", "sigmoid": "Sigmoid"}


def plain_model(network: Network, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model.

    Inputs: points (n + 1, 3) float32 and neighbors (n + 1, N) int32, where row n is the off-screen point. Output:
    probabilities (n + 1, C) float32.
    """
    graph = OnnxGraph()
    x = "points"
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.typed_layers, strict=True)):
        name = f"layer{index}"
        x = _receptive_field(graph, name, layer, x, network.shape.neighbors)
        kernel = graph.constant(f"{name}.kernel", layer.linear.weight.detach().numpy().T)
        bias = graph.constant(f"{name}.bias", layer.linear.bias.detach().numpy())
        x = graph.node("Gemm", [x, kernel, bias], f"{name}.linear")
        last = index == len(network.shape.layers) - 1
        attributes: dict[str, Any] = {"axis": 1} if spec.activation == "softmax" else {}
        output = "probabilities" if last else f"{name}.activation"
        x = graph.node(_OPERATORS[spec.activation], [x], output, **attributes)

    rows = "points_and_off_screen"
    return graph.model(
        {"points": (FLOAT, [rows, 3]), "neighbors": (INT32, [rows, network.shape.neighbors])},
        {"probabilities": (FLOAT, [rows, network.shape.classes])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network. Row n of points and neighbors is the off-screen point: -1, linked to itself.",
    )


def _receptive_field(graph: OnnxGraph, name: str, layer: GraphLayer, x: str, neighbors: int) -> str:
    """Write what the matrix product of a layer takes from x (n + 1, C): (n + 1, inputs of the product)."""
    if isinstance(layer, GraphConvolution | SeparableConvolution):
        gathered = graph.node("Gather", [x, "neighbors"], f"{name}.gathered", axis=0)
    if isinstance(layer, GraphConvolution):
        width = layer.linear.in_features * neighbors // (neighbors + 1)
        flat = graph.node("Reshape", [gathered, graph.constant(f"{name}.shape", [-1, width])], f"{name}.flat")
        return graph.node("Concat", [x, flat], f"{name}.receptive", axis=1)
    if isinstance(layer, SeparableConvolution):
        depthwise = layer.depthwise.detach().numpy()
        around = graph.constant(f"{name}.around", depthwise[1:])
        weighted = graph.node("Mul", [gathered, around], f"{name}.weighted")
        axis = graph.constant(f"{name}.axis", [1])
        summed = graph.node("ReduceSum", [weighted, axis], f"{name}.summed", keepdims=0)
        itself = graph.node("Mul", [x, graph.constant(f"{name}.self", depthwise[0])], f"{name}.itself")
        return graph.node("Add", [summed, itself], f"{name}.receptive")
    return x
