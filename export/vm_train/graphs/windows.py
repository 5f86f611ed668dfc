"""Windows of pictures: a training that looks at parts learns as much from fewer points.

Most of a picture is lawn. A window of half its width and height has a quarter of its points, and if most windows are
put over an object, several times as many objects are seen in the same time. To the network it is the picture of a
smaller camera.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .labeled_graph import LabeledGraph

AIMED = 0.75
"""Share of the windows that show a point of an object, where the picture has one."""


def random_window(
    graph: LabeledGraph, share: float, objects: Sequence[int], random: np.random.Generator
) -> LabeledGraph:
    """The part of a picture's graph in a window of a share of its width and height.

    The same object if that is 1, or if the graph has no points. objects: positions of the classes that most windows are
    put over.
    """
    if share >= 1.0 or not len(graph):
        return graph
    across, down = graph.pixels.T  # numpy takes ten times as long for both at once
    low, high = np.array([across.min(), down.min()]), np.array([across.max(), down.max()])
    size = share * (high - low)
    aim, place, *shift = random.random(4).tolist()
    shown = np.flatnonzero(np.isin(graph.labels, objects)) if aim < AIMED else np.empty(0, dtype=np.intp)
    first, last = low, high - size
    if len(shown):
        aimed = graph.pixels[shown[int(place * len(shown))]]
        first, last = np.maximum(aimed - size, low), np.minimum(aimed, high - size)
    left, top = corner = first + np.array(shift) * (last - first)
    right, bottom = corner + size
    inside = (across >= left) & (across <= right) & (down >= top) & (down <= bottom)
    return graph.part(np.flatnonzero(inside))
