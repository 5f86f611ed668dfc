"""From a picture to what the network sees of it: colored points, their neighbors, and what each of them is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Indices, Singles
from vm_embedded.manifest import Manifest
from vm_embedded.mesh import Mesh, ring_mesh
from vm_embedded.projection import project
from vm_embedded.sampling import sample

from .pictures import Labels, Picture

OFF_SCREEN = -1.0
"""Color of the off-screen point."""


@dataclass(frozen=True)
class Graph:
    """n points of one picture, or of many put together.

    points (n + 1, 3): colors, RGB from 0 to 1; row n is the off-screen point. neighbors (n + 1, N): rows of points.
    labels (n,): positions of classes, -1 where the mask says nothing. distances (n,): from the camera's foot to where
    an object at the point would stand [m].
    """

    points: Singles
    neighbors: Indices
    labels: Labels
    distances: Floats

    def __len__(self) -> int:
        return len(self.labels)


def graph_of(picture: Picture, manifest: Manifest) -> Graph:
    """What a network with this manifest sees of a picture. Raises GeometryError if the camera is too low for a mesh."""
    orientation = picture.lens.orientation
    assert orientation is not None  # read_picture has seen to it
    height, width = picture.labels.shape
    mesh = ring_mesh(manifest.mesh_shape, orientation.height, manifest.intersections, manifest.max_distance)
    lens = picture.lens.lens.for_image((width, height))
    shown = project(mesh, orientation.level, lens, (width, height)).visible
    points = np.full((len(shown) + 1, 3), OFF_SCREEN, dtype=np.float32)
    sample(picture.image, shown.pixels, "bgr", "exact", out=points[:-1])
    x, y = np.rint(shown.pixels).astype(np.intp).T
    return Graph(points, shown.graph.neighbors, picture.labels[y, x], _distances(shown.graph, orientation.height))


def _distances(mesh: Mesh, height: float) -> Floats:
    """Where the rays (n, 3) of a mesh meet the plane [m]; infinite above the horizon."""
    across, down = np.hypot(mesh.rays[:, 0], mesh.rays[:, 1]), -mesh.rays[:, 2]
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(down > 0.0, height * across / down, np.inf))


def together(graphs: Sequence[Graph]) -> tuple[Graph, npt.NDArray[np.intp]]:
    """Graphs as one with one off-screen point, and where each begins (len(graphs) + 1,)."""
    starts = np.cumsum([0, *map(len, graphs)])
    last = int(starts[-1])
    neighbors = [
        np.where(each.neighbors[:-1] == len(each), last, each.neighbors[:-1] + start)
        for each, start in zip(graphs, starts, strict=False)
    ]
    off_screen = np.full((1, graphs[0].neighbors.shape[1]), last)
    joined = Graph(
        np.concatenate([*(each.points[:-1] for each in graphs), graphs[0].points[-1:]]),
        np.concatenate([*neighbors, off_screen]).astype(np.int32),
        np.concatenate([each.labels for each in graphs]),
        np.concatenate([each.distances for each in graphs]),
    )
    return joined, starts
