"""Mirror images: nothing on a field knows left from right, so each picture is worth two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vm_embedded.mesh.mesh import MeshModel

from .labeled_graph import LabeledGraph


def mirrored(graph: LabeledGraph, model: MeshModel) -> LabeledGraph:
    """What a network would see of the mirror image of a picture with a mesh of a model.

    Left and right neighbors change places; pixels stay where they are.
    """
    return replace(graph, neighbors=np.ascontiguousarray(graph.neighbors[:, mirrored_columns(model)]))


def mirrored_columns(model: MeshModel) -> npt.NDArray[np.intp]:
    """Which neighbor (N,) stands in the mirror image where each stood: rings run from left to right, and columns of a
    lattice ahead, so that its rows are what changes sides."""
    if model.steps is None:
        pairs = {here: there for run in model.runs for here, there in zip(run, reversed(run), strict=True)}
        return np.array([pairs[place] for place in range(model.neighbors)])
    slant = len(model.steps) == 6  # each row of such a lattice begins half a column later than the one before
    found = [model.steps.index((column + row if slant else column, -row)) for column, row in model.steps]
    return np.array(found)
