"""The graph of the layout `runs`, the fast one: points as slots that follow each other along their rings.

vm_embedded/network/runs_layout.py prepares its inputs, and explains the words slot, gap, group and column. The
neighbors of a point come in groups that lie beside each other in memory, so a convolution over the graph is:

1. one convolution of width 3 along memory, which gives a sum for each slot and each group of neighbors;
2. one look-up for each group, which gives a point the sums of the slots in the middle of its groups;
3. the sum over the groups.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.mesh.mesh import SELF, Groups
from vm_embedded.network.manifest import METADATA_KEY, Manifest
from vm_embedded.network.runs_layout import group_offsets

from .column_layers import write_layers
from .network import Network
from .onnx_graph import FLOAT, INT64, OnnxGraph


def runs_model(network: Network, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model in the layout `runs`.

    Inputs: points (3, m) float32 and columns (G, m) int64, as RunsLayout gives them. Output: probabilities (C, m)
    float32.
    """
    graph, groups = OnnxGraph(), manifest.model.groups

    def convolve(name: str, x: str, kernel: Floats) -> str:
        return _convolve_along_runs(graph, name, x, kernel, groups)

    write_layers(graph, network, convolve)
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
