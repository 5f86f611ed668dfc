"""The portable graph: points as rows, one Gather and one matrix product for each layer."""

from __future__ import annotations

from typing import Any

from vm_embedded.network.manifest import METADATA_KEY, Manifest

from .graph import FLOAT, INT32, Graph
from .network import GraphConvolution, Network, SeparableConvolution

_OPERATORS = {"selu": "Selu", "relu": "Relu", "elu": "Elu", "tanh": "Tanh", "softmax": "Softmax", "sigmoid": "Sigmoid"}


def plain_graph(network: Network, manifest: Manifest) -> bytes:
    """An ONNX model of the network.

    Inputs: points (n + 1, 3) float32 and neighbors (n + 1, N) int32, where row n is the off-screen point. Output:
    probabilities (n + 1, C) float32.
    """
    graph = Graph()
    x = "points"
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.typed_layers, strict=True)):
        name = f"layer{index}"
        linear = layer.linear
        if isinstance(layer, GraphConvolution | SeparableConvolution):
            gathered = graph.node("Gather", [x, "neighbors"], f"{name}.gathered", axis=0)
        if isinstance(layer, GraphConvolution):
            width = linear.in_features * network.shape.neighbors // (network.shape.neighbors + 1)
            flat = graph.node("Reshape", [gathered, graph.constant(f"{name}.shape", [-1, width])], f"{name}.flat")
            x = graph.node("Concat", [x, flat], f"{name}.receptive", axis=1)
        elif isinstance(layer, SeparableConvolution):
            depthwise = layer.depthwise.detach().numpy()
            around = graph.constant(f"{name}.around", depthwise[1:])
            weighted = graph.node("Mul", [gathered, around], f"{name}.weighted")
            axis = graph.constant(f"{name}.axis", [1])
            summed = graph.node("ReduceSum", [weighted, axis], f"{name}.summed", keepdims=0)
            itself = graph.node("Mul", [x, graph.constant(f"{name}.self", depthwise[0])], f"{name}.itself")
            x = graph.node("Add", [summed, itself], f"{name}.receptive")
        kernel = graph.constant(f"{name}.kernel", linear.weight.detach().numpy().T)
        bias = graph.constant(f"{name}.bias", linear.bias.detach().numpy())
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
