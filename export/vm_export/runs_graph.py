"""The fast graph: points as columns, in runs along their rings; see vm_embedded/network/layout.py for what it takes.

A convolution over the graph is one convolution of width 3 along memory that gives a table of G sums for each point, one
for each group of neighbors, and one look-up of G values for each point. ArrayFeatureExtractor is the fastest operator
for that: one list of columns serves all channels.
"""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.mesh.mesh import SELF, Runs
from vm_embedded.network.manifest import METADATA_KEY, Manifest

from .column_layers import column_layers
from .graph import FLOAT, INT64, Graph
from .network import Network
from .second_look import SecondLook
from .second_look_graph import second_look


def runs_graph(network: Network | SecondLook, manifest: Manifest) -> bytes:
    """An ONNX model of the network.

    Inputs: points (3, m) float32 and columns (G, m) int64, as RunsLayout gives them. Output: probabilities (C, m)
    float32.
    """
    graph = Graph()
    groups = manifest.model.runs

    def convolve(name: str, x: str, kernel: Floats) -> str:
        return _along_runs(graph, name, x, kernel, groups)

    if isinstance(network, SecondLook):
        answers = column_layers(graph, network.first, "points", convolve, "first.", "first.probabilities")
        second_look(graph, network, answers, convolve, groups)
    else:
        column_layers(graph, network, "points", convolve, "", "probabilities")
    return graph.model(
        {"points": (FLOAT, [3, "slots"]), "columns": (INT64, [len(groups), "slots"])},
        {"probabilities": (FLOAT, [network.shape.classes, "slots"])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network, laid out in runs. The slots and their columns are prepared by vm_embedded.",
    )


def _along_runs(graph: Graph, name: str, x: str, kernel: Floats, groups: Runs) -> str:
    """Sums (outputs, m) of a convolution over x (inputs, m)."""
    outputs, _, inputs = kernel.shape
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
    return graph.node("ReduceSum", [grouped, graph.constant("second", [1])], f"{name}.summed", keepdims=0)
