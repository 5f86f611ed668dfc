"""The layers of a network on points side by side, (channels, points), for the graphs of `runs` and `lattice`.

Two rewritings make them fast:

- SELU and ELU become cheap operators. With c = ln(alpha) and u = z + c, their value is max(u, c) + exp(min(u, c)), up
  to a factor and a constant. c goes into the bias of the layer, factor and constant into the weights of the next one
  (`Activation`).
- Two classes with a softmax need one output: the difference of their logits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats

from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution
from .onnx_graph import OnnxGraph

Convolve = Callable[[str, str, Floats], str]
"""Writes the nodes of a convolution without its bias: from a name for the nodes, the name of its input (inputs, m) and
a kernel (outputs, N + 1, inputs), the point itself first, to the name of its output (outputs, m)."""

_FLAT = -30.0
"""The smallest exponent. e^-30 vanishes beside a float32 near 1, and it is far above the denormal numbers, with which
a processor is many times slower."""

_SELU_ALPHA, _SELU_SCALE = 1.6732632423543772, 1.0507009873554805


@dataclass(frozen=True)
class Activation:
    """The parts of an activation that move into the weights of the layers around it.

    With `bias` added before it, activation(z) = scale * nodes(z + bias) + constant. The nodes of SELU and ELU are the
    max and exp in the header, with bias = c.
    """

    bias: float = 0.0
    scale: float = 1.0
    constant: float = 0.0


def _exponential(alpha: float, scale: float) -> Activation:
    bias = math.log(alpha)
    return Activation(bias, scale, -scale * (alpha + bias))


ACTIVATION_PARTS = {
    "selu": _exponential(_SELU_ALPHA, _SELU_SCALE),
    "elu": _exponential(1.0, 1.0),
    "relu": Activation(),
    "tanh": Activation(),
}
"""The parts by the names of activations."""


def write_layers(graph: OnnxGraph, network: Network, convolve: Convolve) -> None:
    """Write all layers of a network, from the input `points` (3, m) to the output `probabilities` (C, m).

    `convolve` writes the convolutions, which look at neighbors.
    """
    x, before = "points", Activation()
    for index, (spec, layer) in enumerate(zip(network.shape.layers, network.typed_layers, strict=True)):
        name = f"layer{index}"
        last = index == len(network.shape.layers) - 1
        kernel, bias = _weights(layer)
        if last and spec.activation == "softmax" and spec.width == 2:
            kernel, bias = kernel[1:] - kernel[:1], bias[1:] - bias[:1]
        activation = Activation() if last else ACTIVATION_PARTS[spec.activation]
        bias = bias + activation.bias + before.constant * kernel.sum(axis=(1, 2))
        kernel = before.scale * kernel
        if kernel.shape[1] == 1:  # a dense layer
            sums = graph.node("MatMul", [graph.constant(f"{name}.kernel", kernel[:, 0]), x], f"{name}.sums")
        else:
            sums = convolve(name, x, kernel)
        z = graph.node("Add", [sums, graph.constant(f"{name}.bias", bias[:, None])], f"{name}.linear")
        if last:
            _write_head(graph, spec.activation, spec.width, z)
        else:
            x = _write_activation(graph, name, spec.activation, z)
        before = activation


def _weights(layer: GraphLayer) -> tuple[Floats, Floats]:
    """Kernel (outputs, N + 1 or 1, inputs), the point itself first, and bias (outputs,) of a layer."""
    weight = layer.linear.weight.detach().numpy().astype(np.float64)
    bias = layer.linear.bias.detach().numpy().astype(np.float64)
    if isinstance(layer, SeparableConvolution):
        return weight[:, None] * layer.depthwise.detach().numpy(), bias
    places = layer.neighbors + 1 if isinstance(layer, GraphConvolution) else 1
    return weight.reshape(len(weight), places, -1), bias


def _write_activation(graph: OnnxGraph, name: str, activation: str, z: str) -> str:
    """Write the nodes of an activation, without the parts that `Activation` moves into the weights."""
    if activation in ("relu", "tanh"):
        return graph.node(activation.capitalize(), [z], f"{name}.activation")
    corner = graph.constant(f"{activation}.corner", ACTIVATION_PARTS[activation].bias)
    straight = graph.node("Clip", [z, corner], f"{name}.straight")
    below = graph.node("Clip", [z, graph.constant("flat", _FLAT), corner], f"{name}.below")
    curved = graph.node("Exp", [below], f"{name}.curved")
    return graph.node("Add", [straight, curved], f"{name}.activation")


def _write_head(graph: OnnxGraph, activation: str, classes: int, logits: str) -> None:
    """Write the head: `probabilities` (C, m) from logits (C, m), or from the difference (1, m) of two classes."""
    if activation == "sigmoid":
        graph.node("Sigmoid", [logits], "probabilities")
    elif classes == 2:
        other = graph.node("Neg", [logits], "head.other")
        graph.node("Sigmoid", [graph.node("Concat", [other, logits], "head.both", axis=0)], "probabilities")
    else:
        largest = graph.node("ReduceMax", [logits], "head.largest", axes=[0])
        powers = graph.node("Exp", [graph.node("Sub", [logits, largest], "head.shifted")], "head.powers")
        total = graph.node("ReduceSum", [powers, graph.constant("first", [0])], "head.total")
        graph.node("Div", [powers, total], "probabilities")
