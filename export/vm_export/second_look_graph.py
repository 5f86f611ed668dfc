"""A second look, written into an ONNX graph: which points are worth it, their own small mesh, and its answers put back.

The runtime knows nothing of it: inputs and output are those of any other network in layout runs.
"""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.mesh.mesh import SELF, Runs
from vm_embedded.network.runs_layout import GAP

from .column_layers import Convolve, column_layers
from .graph import FLOAT, INT64, Graph
from .second_look import Gate, SecondLook


def second_look(graph: Graph, network: SecondLook, answers: str, convolve: Convolve, groups: Runs) -> str:
    """Write what comes after the first network's `answers` (C, m); return the probabilities (C, m).

    convolve: a convolution over all slots.
    """
    worth = _worth(graph, network.gate, answers, convolve, sum(map(len, groups)))
    slots, places = _part(graph, worth, groups)

    def convolve_part(name: str, x: str, kernel: Floats) -> str:
        outputs, places_each, inputs = kernel.shape
        seen = graph.node("ArrayFeatureExtractor", [x, places], f"{name}.seen", domain="ai.onnx.ml")
        shape = graph.constant(f"{name}.receptive.shape", [places_each * inputs, -1])
        receptive = graph.node("Reshape", [seen, shape], f"{name}.receptive")
        weights = graph.constant(f"{name}.kernel", kernel.transpose(0, 2, 1).reshape(outputs, -1))
        return graph.node("MatMul", [weights, receptive], f"{name}.sums")

    points = graph.node("ArrayFeatureExtractor", ["points", slots], "look.points", domain="ai.onnx.ml")
    again = column_layers(graph, network.second, points, convolve_part, "look.", "look.probabilities")
    where = graph.node("Expand", [slots, graph.node("Shape", [again], "look.shape")], "look.where")
    return graph.node("ScatterElements", [answers, where, again], "probabilities", axis=1)


def _worth(graph: Graph, gate: Gate, answers: str, convolve: Convolve, places: int) -> str:
    """1 in slots (1, m) that are worth a second look, 0 in all others."""
    chosen = graph.node("Gather", [answers, graph.constant("gate.classes", list(gate.classes))], "gate.chosen", axis=0)
    largest = graph.node("ReduceMax", [chosen], "gate.largest", axes=[0], keepdims=1)
    above = graph.node("Greater", [largest, graph.constant("gate.above", gate.above)], "gate.passed")
    # Of what is off screen every group is looked up around the gap that stands for it, of all else the first is not.
    row = graph.node("Gather", ["columns", graph.constant("gate.row", [0])], "gate.columns", axis=0)
    off_screen = graph.node("Equal", [row, graph.constant("gate.gap", GAP + 1)], "gate.off_screen")
    shown = graph.node("Not", [off_screen], "gate.shown")
    worth = graph.node("Cast", [graph.node("And", [above, shown], "gate.seeds")], "gate.ring0", to=FLOAT)
    for ring in range(1, gate.rings + 1):
        reached = convolve(f"gate.step{ring}", worth, np.ones((1, places, 1)))
        worth = graph.node("Clip", [reached, "", graph.constant("gate.one", 1.0)], f"gate.ring{ring}")
    return worth


def _part(graph: Graph, worth: str, groups: Runs) -> tuple[str, str]:
    """The slots (k,) of the part's points, the off-screen point first, and the places (N + 1 times k,) in it where each
    of them finds itself and its neighbors, those of the same kind together."""
    one = graph.constant("look.one", [1])
    found = graph.node("Gather", [graph.node("NonZero", [worth], "look.found"), one], "look.slots", axis=0)
    flat = graph.node("Reshape", [found, graph.constant("look.flat", [-1])], "look.shown")
    slots = graph.node("Concat", [graph.constant("look.gap", [GAP]), flat], "look.all", axis=0)

    ends = graph.constant("look.zero", 0), graph.node("Size", [slots], "look.count"), graph.constant("look.step", 1)
    numbers = graph.node("Range", [*ends], "look.numbers")
    # The place of the off-screen point, 0, for every slot that is not in the part.
    whole = graph.node("Cast", [worth], "look.worth", to=INT64)
    nowhere = graph.node("Mul", [whole, graph.constant("look.none", 0)], "look.nowhere")
    row = graph.constant("look.row", [1, -1])
    rows = [graph.node("Reshape", [each, row], f"{each}.row") for each in (slots, numbers)]
    position = graph.node("ScatterElements", [nowhere, *rows], "look.position", axis=1)

    # A slot's group stands in a table of groups times (slots - 1), from its second column on (RunsLayout.columns).
    columns = graph.node("ArrayFeatureExtractor", ["columns", slots], "look.columns", domain="ai.onnx.ml")
    all_slots = graph.node("Size", [worth], "look.size")
    width = graph.node("Sub", [all_slots, graph.constant("look.less", 1)], "look.width")
    starts = graph.node("Mul", [width, graph.constant("look.groups", np.arange(len(groups))[:, None])], "look.starts")
    middles = graph.node("Sub", [columns, starts], "look.middles")
    group_of, shift = _places(groups)
    own = graph.node("Gather", [middles, graph.constant("look.group", group_of)], "look.own", axis=0)
    neighbors = graph.node("Add", [own, graph.constant("look.shift", shift[:, None] - 1)], "look.neighbors")
    every = graph.node("Reshape", [neighbors, graph.constant("look.every.shape", [-1])], "look.every")
    places = graph.node("ArrayFeatureExtractor", [position, every], "look.found.places", domain="ai.onnx.ml")
    return slots, graph.node("Reshape", [places, graph.constant("look.places.shape", [-1])], "look.places")


def _places(groups: Runs) -> tuple[np.ndarray, np.ndarray]:
    """Of each place of a kernel, self first: its group, and how far it is from the group's middle."""
    found = {
        0 if neighbor == SELF else 1 + neighbor: (number, shift)
        for number, group in enumerate(groups)
        for shift, neighbor in enumerate(group, start=-(len(group) // 3))
    }
    ordered = np.array([found[place] for place in range(len(found))])
    return ordered[:, 0], ordered[:, 1]
