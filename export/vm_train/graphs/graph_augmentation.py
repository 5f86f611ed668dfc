"""Windows and mirror images of labeled graphs.

A window is a part of the picture. Most of a picture is grass. A window of half its width and height has a quarter of
the points, and most windows lie over an object. So the network sees several times as many objects in the same time. To
the network, a window is the picture of a camera with a smaller sensor.

A mirror image doubles the pictures, because nothing on a field depends on left and right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vm_embedded.mesh.mesh import MeshModel

from .labeled_graph import LabeledGraph

AIMED = 0.75
"""Share of the windows that contain a point of an object, if the picture has one."""


def random_window(
    graph: LabeledGraph, share: float, objects: Sequence[int], random: np.random.Generator
) -> LabeledGraph:
    """Cut a window of a share of the picture's width and height out of a graph.

    Returns the same object if share is 1 or the graph has no points. objects: positions of the classes that most
    windows lie over.
    """
    if share >= 1.0 or not len(graph):
        return graph
    across, down = graph.pixels.T  # numpy takes ten times as long for both at once
    low, high = np.array([across.min(), down.min()]), np.array([across.max(), down.max()])
    size = share * (high - low)
    aim, place, *shift = random.random(4).tolist()
    shown = np.flatnonzero(np.isin(graph.labels, objects)) if aim < AIMED else np.empty(0, dtype=np.intp)
    first, last = low, high - size  # limits of the window's upper left corner
    if len(shown):
        aimed = graph.pixels[shown[int(place * len(shown))]]
        first, last = np.maximum(aimed - size, low), np.minimum(aimed, high - size)
    left, top = corner = first + np.array(shift) * (last - first)
    right, bottom = corner + size
    inside = (across >= left) & (across <= right) & (down >= top) & (down <= bottom)
    return graph.part(np.flatnonzero(inside))


def mirror_image(graph: LabeledGraph, model: MeshModel) -> LabeledGraph:
    """The graph that a network would get of the picture's mirror image, for a mesh of this model.

    Left and right neighbors, or the columns of strips, change places; `pixels` keeps the places in the picture itself.
    """
    if graph.cells is not None:
        columns, rows = graph.cells.T
        last = columns.max(initial=0)
        turned = replace(graph, cells=np.stack([last - columns, rows], axis=1))
        if graph.objects is None:
            return turned
        objects = graph.objects.copy()
        objects[:, 1] = last - objects[:, 1]
        return replace(turned, objects=objects)
    return replace(graph, neighbors=np.ascontiguousarray(graph.neighbors[:, mirrored_columns(model)]))


def mirrored_columns(model: MeshModel) -> npt.NDArray[np.intp]:
    """For each column of `neighbors`, the column that takes its place in the mirror image (N,).

    Rings run from left to right, so left and right are swapped. A lattice's columns point ahead of the robot,
    so a step of r rows to one side becomes a step of r rows to the other.
    """
    if model.steps is None:
        return np.array(model.mirrored)
    slant = len(model.steps) == 6  # each row of such a lattice begins half a column after the one before
    return np.array([model.steps.index((column + row if slant else column, -row)) for column, row in model.steps])
