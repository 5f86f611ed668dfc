"""The fast graph: points as columns, in runs along their rings; see vm_embedded/layout.py for what it takes.

What makes it fast, and leaves the answers as they are:

- A convolution over the graph is one convolution of width 3 along memory that gives a table of G sums for each point,
  one for each group of neighbors, and one look-up of G values for each point. ArrayFeatureExtractor is the fastest
  operator for that: one list of columns serves all channels.
- SELU and ELU are taken apart into cheap operators. With c = ln(alpha) and u = z + c, their value is up to a factor and
  a constant max(u, c) + exp(min(u, c)); c goes into the layer's own bias, factor and constant into the next layer.
- Two classes need one output: the difference of their logits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.manifest import METADATA_KEY, Manifest
from vm_embedded.mesh import RUNS, SELF

from .graph import FLOAT, INT64, Graph
from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution

_SELU_ALPHA, _SELU_SCALE = 1.6732632423543772, 1.0507009873554805


@dataclass(frozen=True)
class _Activation:
    """What an activation leaves to its neighbors: its value is scale * (what its nodes give) + constant, if its input
    has the bias added."""

    bias: float = 0.0
    scale: float = 1.0
    constant: float = 0.0


def _exponential(alpha: float, scale: float) -> _Activation:
    bias = math.log(alpha)
    return _Activation(bias, scale, -scale * (alpha + bias))


_ACTIVATIONS = {
    "selu": _exponential(_SELU_ALPHA, _SELU_SCALE),
    "elu": _exponential(1.0, 1.0),
    "relu": _Activation(),
    "tanh": _Activation(),
}


def runs_graph(network: Network, manifest: Manifest) -> bytes:
    """An ONNX model of the network.

    Inputs: points (3, m) float32 and columns (G, m) int64, as RunsLayout gives them. Output: probabilities (C, m)
    float32.
    """
    graph = Graph()
    groups = RUNS[manifest.mesh]
    before = _Activation()
    x = "points"
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.typed_layers, strict=True)):
        name = f"layer{index}"
        kernel, bias = _weights(layer)
        if index == len(network.shape.layers) - 1:
            if spec.activation == "softmax" and spec.width == 2:
                kernel, bias = kernel[1:] - kernel[:1], bias[1:] - bias[:1]
            x = _head(graph, spec.activation, spec.width, _convolution(graph, name, x, kernel, bias, before, groups))
        else:
            activation = _ACTIVATIONS[spec.activation]
            z = _convolution(graph, name, x, kernel, bias + activation.bias, before, groups)
            x = _activation(graph, name, spec.activation, z)
            before = activation

    return graph.model(
        {"points": (FLOAT, [3, "slots"]), "columns": (INT64, [len(groups), "slots"])},
        {"probabilities": (FLOAT, [network.shape.classes, "slots"])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network, laid out in runs. The slots and their columns are prepared by vm_embedded.",
    )


def _weights(layer: GraphLayer) -> tuple[Floats, Floats]:
    """Kernel (outputs, N + 1 or 1, inputs), self first, and bias (outputs,) of a layer."""
    weight = layer.linear.weight.detach().numpy().astype(np.float64)
    bias = layer.linear.bias.detach().numpy().astype(np.float64)
    if isinstance(layer, SeparableConvolution):
        return weight[:, None] * layer.depthwise.detach().numpy(), bias
    places = layer.neighbors + 1 if isinstance(layer, GraphConvolution) else 1
    return weight.reshape(len(weight), places, -1), bias


def _convolution(
    graph: Graph,
    name: str,
    x: str,
    kernel: Floats,
    bias: Floats,
    before: _Activation,
    groups: tuple[tuple[int, ...], ...],
) -> str:
    """Sums (outputs, m) of a layer over x (inputs, m), which is what the activation `before` left of its values."""
    bias = bias + before.constant * kernel.sum(axis=(1, 2))
    kernel = before.scale * kernel
    outputs, places, inputs = kernel.shape
    biases = graph.constant(f"{name}.bias", bias[:, None])
    if places == 1:
        weights = graph.constant(f"{name}.kernel", kernel[:, 0])
        return graph.node("Add", [graph.node("MatMul", [weights, x], f"{name}.sums"), biases], f"{name}.linear")

    # In memory x, x and x without its last three columns, row after row. Cut into rows one shorter than x, each row
    # begins one column earlier in x than the one before: at (j, j - 1, j - 2), which is a window around j - 1.
    ends = [graph.constant(f"slice.{key}", [value]) for key, value in (("start", 0), ("end", -3), ("axis", 1))]
    most = graph.node("Slice", [x, *ends], f"{name}.most")
    thrice = graph.node("Concat", [x, x, most], f"{name}.thrice", axis=1)
    window = graph.node("Reshape", [thrice, graph.constant(f"{name}.window.shape", [3 * inputs, -1])], f"{name}.window")

    taps = np.zeros((outputs, len(groups), inputs, 3))
    for number, group in enumerate(groups):
        for place, neighbor in enumerate(group, start=-(len(group) // 3)):
            taps[:, number, :, 1 - place] = kernel[:, 0 if neighbor == SELF else 1 + neighbor]
    weights = graph.constant(f"{name}.kernel", taps.reshape(outputs * len(groups), 3 * inputs))
    sums = graph.node("MatMul", [weights, window], f"{name}.sums")
    table = graph.node("Reshape", [sums, graph.constant(f"{name}.table.shape", [outputs, -1])], f"{name}.table")
    found = graph.node("ArrayFeatureExtractor", [table, "columns"], f"{name}.found", domain="ai.onnx.ml")
    shape = graph.constant(f"{name}.groups.shape", [outputs, len(groups), -1])
    grouped = graph.node("Reshape", [found, shape], f"{name}.groups")
    summed = graph.node("ReduceSum", [grouped, graph.constant("second", [1])], f"{name}.summed", keepdims=0)
    return graph.node("Add", [summed, biases], f"{name}.linear")


def _activation(graph: Graph, name: str, activation: str, z: str) -> str:
    """Node of an activation; see `_Activation` for what it leaves out."""
    if activation in ("relu", "tanh"):
        return graph.node(activation.capitalize(), [z], f"{name}.activation")
    corner = graph.constant(f"{activation}.corner", _ACTIVATIONS[activation].bias)
    straight = graph.node("Clip", [z, corner], f"{name}.straight")
    below = graph.node("Clip", [z, "", corner], f"{name}.below")
    curved = graph.node("Exp", [below], f"{name}.curved")
    return graph.node("Add", [straight, curved], f"{name}.activation")


def _head(graph: Graph, activation: str, classes: int, logits: str) -> str:
    """Probabilities (classes, m) from logits (classes, m), or (1, m) where two classes need only their difference."""
    if activation == "sigmoid":
        return graph.node("Sigmoid", [logits], "probabilities")
    if classes == 2:
        other = graph.node("Neg", [logits], "head.other")
        return graph.node("Sigmoid", [graph.node("Concat", [other, logits], "head.both", axis=0)], "probabilities")
    largest = graph.node("ReduceMax", [logits], "head.largest", axes=[0])
    powers = graph.node("Exp", [graph.node("Sub", [logits, largest], "head.shifted")], "head.powers")
    total = graph.node("ReduceSum", [powers, graph.constant("first", [0])], "head.total")
    return graph.node("Div", [powers, total], "probabilities")
