"""The graph of the layout `runs`, the fast one: points as slots that follow each other along their rings.

vm_embedded/network/runs_layout.py prepares its inputs, and explains the words slot, gap, group and column. The
neighbors of a point come in groups that lie beside each other in memory, so a convolution over the graph is:

1. one convolution of width 3 along memory, which gives a sum for each slot and each group of neighbors;
2. one look-up for each group, which gives a point the sums of the slots in the middle of its groups;
3. the sum over the groups.

Two rewritings of the layers make them fast, too:

- SELU and ELU become cheap operators. With c = ln(alpha) and u = z + c, their value is max(u, c) + exp(min(u, c)), up
  to a factor and a constant. c goes into the bias of the layer, factor and constant into the weights of the next one
  (`Activation`).
- Two classes with a softmax need one output: the difference of their logits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.mesh.mesh import SELF, Groups
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.runs_layout import group_offsets

from .network import GraphConvolution, GraphLayer, Network, SeparableConvolution
from .onnx_graph import FLOAT, INT64, OnnxGraph

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


def runs_model(network: Network, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model in the layout `runs`.

    Inputs: points (3, m) float32 and columns (G, m) int64, as RunsLayout gives them. Output: probabilities (C, m)
    float32.
    """
    graph, groups = OnnxGraph(), manifest.model.groups
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
            sums = _convolve_along_runs(graph, name, x, kernel, groups)
        z = graph.node("Add", [sums, graph.constant(f"{name}.bias", bias[:, None])], f"{name}.linear")
        if last:
            _write_head(graph, spec.activation, spec.width, z)
        else:
            x = _write_activation(graph, name, spec.activation, z)
        before = activation
    return graph.model(
        {"points": (FLOAT, [3, "slots"]), "columns": (INT64, [len(groups), "slots"])},
        {"probabilities": (FLOAT, [network.shape.classes, "slots"])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network, laid out in runs. The slots and their columns are prepared by vm_embedded.",
    )


def _convolve_along_runs(graph: OnnxGraph, name: str, x: str, kernel: Floats, groups: Groups) -> str:
    """Write a convolution over the graph; return the name of its sums (outputs, m), from x (inputs, m)."""
    outputs, _, inputs = kernel.shape
    # All windows of three slots, without a copy of each. A row of `thrice` holds a channel of x twice, and a third time
    # without its last three slots: 3 (m - 1) values. Cut into three rows of m - 1 values, each row begins one slot
    # earlier in x than the row before. Entry j of these rows is x at j, j - 1 and j - 2: a window around j - 1. (From
    # j = 2 on; x begins with gaps, so nothing looks up the first two.)
    cut = [graph.constant(f"slice.{key}", [value]) for key, value in (("start", 0), ("end", -3), ("axis", 1))]
    most = graph.node("Slice", [x, *cut], f"{name}.most")
    thrice = graph.node("Concat", [x, x, most], f"{name}.thrice", axis=1)
    window = graph.node("Reshape", [thrice, graph.constant(f"{name}.window.shape", [3 * inputs, -1])], f"{name}.window")

    taps = np.zeros((outputs, len(groups), inputs, 3))
    for place, group, shift in kernel_places(groups):  # row 0 of a window is its right slot, shift +1
        taps[:, group, :, 1 - shift] = kernel[:, place]
    weights = graph.constant(f"{name}.kernel", taps.reshape(outputs * len(groups), 3 * inputs))
    sums = graph.node("MatMul", [weights, window], f"{name}.sums")

    # The sums of all groups as one table (outputs, G * (m - 1)): `columns` points to the middles of a point's groups.
    table = graph.node("Reshape", [sums, graph.constant(f"{name}.table.shape", [outputs, -1])], f"{name}.table")
    found = graph.columns_of(table, "columns", f"{name}.found")
    shape = graph.constant(f"{name}.groups.shape", [outputs, len(groups), -1])
    grouped = graph.node("Reshape", [found, shape], f"{name}.groups")
    return graph.node("ReduceSum", [grouped, graph.constant("second", [1])], f"{name}.summed", keepdims=0)


def kernel_places(groups: Groups) -> Iterator[tuple[int, int, int]]:
    """For each place of a kernel (0 is the point itself): its group, and its offset from the group's middle."""
    for number, group in enumerate(groups):
        for shift, neighbor in zip(group_offsets(group), group, strict=True):
            yield (0 if neighbor == SELF else 1 + neighbor), number, shift


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
