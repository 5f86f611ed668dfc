"""The output of a network's graph: the probabilities of classes, and behind them the shifts, if it has them."""

from __future__ import annotations

from collections.abc import Callable

from vm_embedded.network.manifest import SHIFTS

from .onnx_graph import OnnxGraph

PROBABILITIES = "head.probabilities"
"""Name of the probabilities alone, in the graph of a network with shifts."""

Head = Callable[[str, str], None]
"""Writes the activation of the last layer, from the name of the logits to that of the probabilities."""


def write_output(graph: OnnxGraph, last: str, logits: int, has_shifts: bool, axis: int, write_head: Head) -> None:
    """Write the output `probabilities` from what the last layer gives: so many logits, then the shifts.

    axis: along which they lie.
    """
    if not has_shifts:
        write_head(last, "probabilities")
        return
    write_head(graph.slice(last, 0, logits, axis, "head.logits"), PROBABILITIES)
    shifts = graph.slice(last, logits, logits + SHIFTS, axis, "head.shifts")
    graph.node("Concat", [PROBABILITIES, shifts], "probabilities", axis=axis)
