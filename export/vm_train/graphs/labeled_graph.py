"""From a labeled picture to the graph that a network learns from: colored points, their neighbors and labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Indices, Singles
from vm_embedded.detection.color_normalization import normalized
from vm_embedded.detection.footprint import Levels, levels_for, uniform_levels
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.sampling import sample
from vm_embedded.mesh.dilation import with_dilations
from vm_embedded.network.layout import OFF_SCREEN
from vm_embedded.network.manifest import Manifest
from vm_export.grid import VISUAL, Grid

from ..data.classes import Labels
from ..data.pictures import Picture
from .seen_points import seen_points


@dataclass(frozen=True)
class LabeledGraph:
    """n points of one picture, or of several joined.

    points (n + 1, 3): colors, RGB from 0 to 1; row n is the off-screen point. neighbors (n + 1, D N): rows of points,
    as with_dilations gives them. labels (n,): positions of classes, -1 for unlabeled. distances (n,): along the plane,
    from the camera to an object at the point [m]. pixels (n, 2): places of the points in their pictures, (x, y) [px].
    """

    points: Singles
    neighbors: Indices
    labels: Labels
    distances: Floats
    pixels: Floats

    def __len__(self) -> int:
        return len(self.labels)

    def part(self, kept: npt.NDArray[np.intp]) -> LabeledGraph:
        """The graph of the points `kept`, in that order. Links to other points lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = np.append(kept, len(self))
        neighbors = position[self.neighbors[rows]]
        return LabeledGraph(self.points[rows], neighbors, self.labels[kept], self.distances[kept], self.pixels[kept])


def graph_of(picture: Picture, manifest: Manifest, grid: Grid = VISUAL) -> LabeledGraph:
    """The graph of a picture for a network with this manifest. Raises GeometryError or InputError as seen_points."""
    shown = seen_points(picture.lens, picture.size, manifest, grid)
    points = np.full((len(shown) + 1, 3), OFF_SCREEN, dtype=np.float32)
    levels = levels_of(picture, shown.graph.rays, manifest, grid)
    points[:-1] = normalized(sample(Pyramid(picture.image, "bgr"), shown.pixels, levels), manifest.colors).T
    x, y = np.rint(shown.pixels).astype(np.intp).T
    distances = plane_distances(shown.graph.rays, picture.orientation.height)
    neighbors = with_dilations(shown.graph.neighbors, manifest.model.groups, manifest.dilations)
    return LabeledGraph(points, neighbors, picture.labels[y, x], distances, shown.pixels)


def levels_of(picture: Picture, rays: Floats, manifest: Manifest, grid: Grid) -> Levels:
    """Which picture of the pyramid colors each of the points with rays (n, 3)."""
    if grid.is_visual:
        return levels_for(manifest, rays, picture.orientation.height, picture.fitted_lens)
    width, height = picture.size
    single = manifest.sampling == "bilinear"
    return uniform_levels(len(rays), 1.0 if single else math.sqrt(height * width / max(len(rays), 1)))


def plane_distances(rays: Floats, height: float) -> Floats:
    """Distance from the camera's foot to where rays (n, 3) meet the plane (n,) [m]; infinite above the horizon."""
    across, down = np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(down > 0.0, height * across / down, np.inf))


def empty_graph(columns: int) -> LabeledGraph:
    """A graph without points, whose off-screen point has that many columns of neighbors."""
    return LabeledGraph(
        np.full((1, 3), OFF_SCREEN, dtype=np.float32),
        np.zeros((1, columns), dtype=np.int32),
        np.empty(0, dtype=np.int8),
        np.empty(0),
        np.empty((0, 2)),
    )


def join_graphs(graphs: Sequence[LabeledGraph]) -> tuple[LabeledGraph, npt.NDArray[np.intp]]:
    """Several graphs as one with a single off-screen point, and where each begins (len(graphs) + 1,)."""
    starts = np.cumsum([0, *map(len, graphs)])
    last = int(starts[-1])
    neighbors = [
        np.where(each.neighbors[:-1] == len(each), last, each.neighbors[:-1] + start)
        for each, start in zip(graphs, starts, strict=False)
    ]
    off_screen = np.full((1, graphs[0].neighbors.shape[1]), last)
    joined = LabeledGraph(
        np.concatenate([*(each.points[:-1] for each in graphs), graphs[0].points[-1:]]),
        np.concatenate([*neighbors, off_screen]).astype(np.int32),
        np.concatenate([each.labels for each in graphs]),
        np.concatenate([each.distances for each in graphs]),
        np.concatenate([each.pixels for each in graphs]),
    )
    return joined, starts
