"""A network's layers on points as columns, written into an ONNX graph.

- SELU and ELU are taken apart into cheap operators. With c = ln(alpha) and u = z + c, their value is up to a factor and
  a constant max(u, c) + exp(min(u, c)); c goes into the layer's own bias, factor and constant into the next layer.
- Two classes need one output: the difference of their logits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats

from .graph import Graph
from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution

Convolve = Callable[[str, str, Floats], str]
"""Sums (outputs, m) of a convolution without its bias, from a name for its nodes, the name of what it takes (inputs, m)
and a kernel (outputs, N + 1, inputs), self first."""

_FLAT = -30.0
"""Below it an exponential is counted as e^-30: less than a float32 near 1 can show, and far above the denormal numbers,
with which a processor counts many times slower."""

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


def column_layers(graph: Graph, network: Network, x: str, convolve: Convolve, name: str, output: str) -> str:
    """Write all layers of a network; return `output`, its probabilities (C, m), from x (3, m).

    Nodes are called after `name`; `convolve` writes what looks at neighbors.
    """
    before = _Activation()
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.typed_layers, strict=True)):
        each = f"{name}layer{index}"
        kernel, bias = _weights(layer)
        last = index == len(network.shape.layers) - 1
        if last and spec.activation == "softmax" and spec.width == 2:
            kernel, bias = kernel[1:] - kernel[:1], bias[1:] - bias[:1]
        activation = _Activation() if last else _ACTIVATIONS[spec.activation]
        bias = bias + activation.bias + before.constant * kernel.sum(axis=(1, 2))
        kernel = before.scale * kernel
        if kernel.shape[1] == 1:
            sums = graph.node("MatMul", [graph.constant(f"{each}.kernel", kernel[:, 0]), x], f"{each}.sums")
        else:
            sums = convolve(each, x, kernel)
        z = graph.node("Add", [sums, graph.constant(f"{each}.bias", bias[:, None])], f"{each}.linear")
        if last:
            _head(graph, name, spec.activation, spec.width, z, output)
        else:
            x = _activation(graph, each, spec.activation, z)
        before = activation
    return output


def _weights(layer: GraphLayer) -> tuple[Floats, Floats]:
    """Kernel (outputs, N + 1 or 1, inputs), self first, and bias (outputs,) of a layer."""
    weight = layer.linear.weight.detach().numpy().astype(np.float64)
    bias = layer.linear.bias.detach().numpy().astype(np.float64)
    if isinstance(layer, SeparableConvolution):
        return weight[:, None] * layer.depthwise.detach().numpy(), bias
    places = layer.neighbors + 1 if isinstance(layer, GraphConvolution) else 1
    return weight.reshape(len(weight), places, -1), bias


def _activation(graph: Graph, name: str, activation: str, z: str) -> str:
    """Node of an activation; see `_Activation` for what it leaves out."""
    if activation in ("relu", "tanh"):
        return graph.node(activation.capitalize(), [z], f"{name}.activation")
    corner = graph.constant(f"{activation}.corner", _ACTIVATIONS[activation].bias)
    straight = graph.node("Clip", [z, corner], f"{name}.straight")
    below = graph.node("Clip", [z, graph.constant("flat", _FLAT), corner], f"{name}.below")
    curved = graph.node("Exp", [below], f"{name}.curved")
    return graph.node("Add", [straight, curved], f"{name}.activation")


def _head(graph: Graph, name: str, activation: str, classes: int, logits: str, output: str) -> str:
    """Probabilities (classes, m) from logits (classes, m), or (1, m) where two classes need only their difference."""
    head = f"{name}head"
    if activation == "sigmoid":
        return graph.node("Sigmoid", [logits], output)
    if classes == 2:
        other = graph.node("Neg", [logits], f"{head}.other")
        return graph.node("Sigmoid", [graph.node("Concat", [other, logits], f"{head}.both", axis=0)], output)
    largest = graph.node("ReduceMax", [logits], f"{head}.largest", axes=[0])
    powers = graph.node("Exp", [graph.node("Sub", [logits, largest], f"{head}.shifted")], f"{head}.powers")
    total = graph.node("ReduceSum", [powers, graph.constant("first", [0])], f"{head}.total")
    return graph.node("Div", [powers, total], output)
