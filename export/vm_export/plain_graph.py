"""The ONNX graph of a network on a graph: points as rows, one Gather and one matrix product per layer."""

from __future__ import annotations

from typing import Any

from vm_embedded.network.manifest import METADATA_KEY, Manifest

from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution
from .onnx_graph import FLOAT, INT32, OnnxGraph

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
