"""The graph of a network with a second look, in the layout `runs`.

The graph has four parts:

1. the first network answers for all slots;
2. the gate selects slots, and adds the rings of neighbors around them;
3. the selected points become a small mesh, in which all other points are the off-screen point;
4. the second network answers for the small mesh, and its answers replace those of the first one.

Inputs and output are those of every other network in the layout `runs`, so the runtime does not know of the second
look.
The small mesh has few points and no runs: each place of a receptive field is looked up alone.
"""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.mesh.mesh import Groups
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.runs_layout import GAP

from .column_layers import Convolve, write_layers
from .onnx_graph import FLOAT, INT64, OnnxGraph
from .runs_graph import convolve_along_runs, finished_runs_model, kernel_places
from .second_look import Gate, SecondLook


def second_look_model(network: SecondLook, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model in the layout `runs`, with inputs and output as `runs_model` gives them."""
    graph, groups = OnnxGraph(), manifest.model.groups

    def convolve(name: str, x: str, kernel: Floats) -> str:
        return convolve_along_runs(graph, name, x, kernel, groups)

    answers = write_layers(graph, network.first, "points", convolve, "first.", "first.probabilities")
    selected = _write_gate(graph, network.gate, answers, convolve, sum(map(len, groups)))
    slots = _write_slots(graph, selected)
    positions = _write_positions(graph, selected, slots)
    fields = _write_receptive_fields(graph, selected, slots, positions, groups)

    def convolve_small_mesh(name: str, x: str, kernel: Floats) -> str:
        outputs, places, inputs = kernel.shape
        seen = graph.columns_of(x, fields, f"{name}.seen")  # (inputs, places * k)
        shape = graph.constant(f"{name}.receptive.shape", [inputs * places, -1])
        receptive = graph.node("Reshape", [seen, shape], f"{name}.receptive")
        weights = graph.constant(f"{name}.kernel", kernel.transpose(0, 2, 1).reshape(outputs, -1))
        return graph.node("MatMul", [weights, receptive], f"{name}.sums")

    points = graph.columns_of("points", slots, "look.points")
    again = write_layers(graph, network.second, points, convolve_small_mesh, "look.", "look.probabilities")
    # ScatterElements needs the slot of each element, so all rows of classes get the same slots.
    where = graph.node("Expand", [slots, graph.node("Shape", [again], "look.shape")], "look.where")
    graph.node("ScatterElements", [answers, where, again], "probabilities", axis=1)
    return finished_runs_model(graph, network.shape.classes, manifest)


def _write_gate(graph: OnnxGraph, gate: Gate, answers: str, convolve: Convolve, places: int) -> str:
    """Write the gate; return the name of a mask (1, m) float32: 1 in the slots that get a second look, else 0.

    answers: the first network's probabilities (C, m). convolve: a convolution over all slots, with `places` places.
    """
    chosen = graph.node("Gather", [answers, graph.constant("gate.classes", list(gate.classes))], "gate.chosen", axis=0)
    largest = graph.node("ReduceMax", [chosen], "gate.largest", axes=[0], keepdims=1)
    passed = graph.node("Greater", [largest, graph.constant("gate.above", gate.above)], "gate.passed")
    # The first group holds the point itself, so its middle is the point's own slot; only slots off screen look up the
    # gap there. The window around the gap is in column GAP + 1 of the table.
    first_group = graph.node("Gather", ["columns", graph.constant("gate.row", [0])], "gate.columns", axis=0)
    off_screen = graph.node("Equal", [first_group, graph.constant("gate.gap", GAP + 1)], "gate.off_screen")
    shown = graph.node("Not", [off_screen], "gate.shown")
    selected = graph.node("Cast", [graph.node("And", [passed, shown], "gate.seeds")], "gate.ring0", to=FLOAT)
    # A convolution whose weights are ones counts the selected slots in each receptive field: above 0 is one ring more.
    for ring in range(1, gate.rings + 1):
        count = convolve(f"gate.step{ring}", selected, np.ones((1, places, 1)))
        selected = graph.node("Clip", [count, "", graph.constant("gate.one", 1.0)], f"gate.ring{ring}")
    return selected


def _write_slots(graph: OnnxGraph, selected: str) -> str:
    """Write the slots (k,) of the small mesh's points: first a gap, as its off-screen point, then the selected ones."""
    # NonZero gives row and column indices of the mask; its second row lists the slots.
    second = graph.constant("look.one", [1])
    found = graph.node("Gather", [graph.node("NonZero", [selected], "look.found"), second], "look.slots", axis=0)
    flat = graph.node("Reshape", [found, graph.constant("look.flat", [-1])], "look.shown")
    return graph.node("Concat", [graph.constant("look.gap", [GAP]), flat], "look.all", axis=0)


def _write_positions(graph: OnnxGraph, selected: str, slots: str) -> str:
    """Write the position (1, m) of each slot among the small mesh's points; 0, the off-screen point, for all others."""
    ends = graph.constant("look.zero", 0), graph.node("Size", [slots], "look.count"), graph.constant("look.step", 1)
    numbers = graph.node("Range", [*ends], "look.numbers")  # 0 to k - 1
    whole = graph.node("Cast", [selected], "look.worth", to=INT64)
    zeros = graph.node("Mul", [whole, graph.constant("look.none", 0)], "look.nowhere")
    row = graph.constant("look.row", [1, -1])
    rows = [graph.node("Reshape", [each, row], f"{each}.row") for each in (slots, numbers)]
    return graph.node("ScatterElements", [zeros, *rows], "look.position", axis=1)


def _write_receptive_fields(graph: OnnxGraph, selected: str, slots: str, positions: str, groups: Groups) -> str:
    """Write where in the small mesh its points find themselves and their neighbors: positions (places * k,).

    All points' positions for the first place of a kernel come first, then those for the second place, and so on.
    """
    # `columns` points to the middle slots of groups in a flattened table (groups, m - 1). The sum around slot s is in
    # column s + 1 of it (runs_graph.py). To get the slots back, subtract the start of the group's row, and then 1.
    columns = graph.columns_of("columns", slots, "look.columns")  # (groups, k)
    all_slots = graph.node("Size", [selected], "look.size")
    width = graph.node("Sub", [all_slots, graph.constant("look.less", 1)], "look.width")
    starts = graph.node("Mul", [width, graph.constant("look.groups", np.arange(len(groups))[:, None])], "look.starts")
    middles = graph.node("Sub", [columns, starts], "look.middles")  # each group's middle slot, plus 1

    # Places of the kernel in order: (place, group, shift from the group's middle slot).
    _, group_of, shift = np.array(sorted(kernel_places(groups))).T
    own = graph.node("Gather", [middles, graph.constant("look.group", group_of)], "look.own", axis=0)
    neighbors = graph.node("Add", [own, graph.constant("look.shift", shift[:, None] - 1)], "look.neighbors")
    flat = graph.node("Reshape", [neighbors, graph.constant("look.every.shape", [-1])], "look.every")
    found = graph.columns_of(positions, flat, "look.found.places")
    return graph.node("Reshape", [found, graph.constant("look.places.shape", [-1])], "look.places")
