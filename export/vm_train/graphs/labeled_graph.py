"""From a labeled picture to the graph that a network learns from: colored points, their neighbors and labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Indices, Mask, Singles
from vm_embedded.detection.footprint import Levels, levels_for, uniform_levels
from vm_embedded.detection.pyramid import Pyramid
from vm_embedded.detection.sampling import normalized, sample
from vm_embedded.mesh.mesh import STRIDE, PointGraph
from vm_embedded.network.layout import OFF_SCREEN
from vm_embedded.network.manifest import Manifest
from vm_export.grid import VISUAL, Grid

from ..data.classes import Labels
from ..data.pictures import Picture
from .peak_targets import in_cells
from .seen_points import seen_points
from .true_places import TruePlace, pixels_of

CONTEXT = np.int8(-2)
"""Label of a point in the margin of its mesh, which is no part of the answer."""


@dataclass(frozen=True)
class LabeledGraph:
    """n points of one picture, or of several joined.

    points (n + 1, 3): colors, RGB from 0 to 1; row n is the off-screen point. neighbors (n + 1, N): rows of points.
    labels (n,): positions of classes, -1 for unlabeled, or CONTEXT. distances (n,): along the plane, from the camera to
    an object at the point [m]. pixels (n, 2): places of the points in their pictures, (x, y) [px]. cells (n, 2):
    columns and rows of points on strips (mesh octaves), which have no neighbors; else None. objects (o, 5): what a
    network with peaks learns, as `in_cells` gives it, of a graph that is not joined; else None.
    """

    points: Singles
    neighbors: Indices
    labels: Labels
    distances: Floats
    pixels: Floats
    cells: Indices | None = None
    objects: Singles | None = None

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def around(self) -> Indices:
        """What a network needs to know besides the colors: cells, or else neighbors."""
        return self.neighbors if self.cells is None else self.cells

    @property
    def counted(self) -> Mask | None:
        """The points (n,) whose colors count for the mean of the picture, all but those of context; None for all."""
        return None if self.cells is None else self.labels != CONTEXT

    def part(self, kept: npt.NDArray[np.intp]) -> LabeledGraph:
        """The graph of the points `kept`, in that order. Links to other points lead to the off-screen point."""
        position = np.full(len(self) + 1, len(kept), dtype=np.int32)
        position[kept] = np.arange(len(kept), dtype=np.int32)
        rows = np.append(kept, len(self))
        neighbors = position[self.neighbors[rows]]
        cells = None if self.cells is None else self.cells[kept]
        return LabeledGraph(
            self.points[rows],
            neighbors,
            self.labels[kept],
            self.distances[kept],
            self.pixels[kept],
            cells,
            self.objects,
        )


def graph_of(
    picture: Picture, manifest: Manifest, grid: Grid = VISUAL, places: Sequence[TruePlace] = ()
) -> LabeledGraph:
    """The graph of a picture for a network with this manifest. Raises GeometryError or InputError as seen_points.

    places: of the picture's objects, for a network with peaks.
    """
    shown = seen_points(picture.lens, picture.size, manifest, grid)
    strips, margin = shown.graph.strips, shown.graph.margin
    if strips is not None and margin is not None:  # as in a canvas, which leaves out strips of context only
        shown = shown.only(np.isin(strips, strips[~margin])).visible
    x, y = np.rint(shown.pixels).astype(np.intp).T
    labels = picture.labels[y, x]
    if shown.graph.margin is None:
        neighbors, cells = shown.graph.neighbors, None
    else:
        neighbors, cells = np.zeros((len(shown) + 1, 0), dtype=np.int32), shown.graph.cells
        labels = np.where(shown.graph.margin, CONTEXT, labels)
    objects = None
    if manifest.peaks:
        toward = picture.fitted_lens.unproject(pixels_of(places), picture.size)
        objects = in_cells(places, toward @ picture.orientation.level.T, shown.graph, manifest)
    points = np.full((len(shown) + 1, 3), OFF_SCREEN, dtype=np.float32)
    distances = plane_distances(shown.graph.rays, picture.orientation.height)
    graph = LabeledGraph(points, neighbors, labels, distances, shown.pixels, cells, objects)
    levels = levels_of(picture, shown.graph, manifest, grid)
    colors = sample(Pyramid(picture.image, "bgr"), shown.pixels, levels)
    points[:-1] = normalized(colors, manifest.colors, graph.counted).T
    return graph


def levels_of(picture: Picture, graph: PointGraph, manifest: Manifest, grid: Grid) -> Levels:
    """Which picture of the pyramid colors each of the points."""
    if grid.is_visual:
        return levels_for(manifest, graph, picture.orientation.height, picture.fitted_lens)
    width, height = picture.size
    single = manifest.sampling == "bilinear"
    return uniform_levels(len(graph), 1.0 if single else math.sqrt(height * width / max(len(graph), 1)))


def plane_distances(rays: Floats, height: float) -> Floats:
    """Distance from the camera's foot to where rays (n, 3) meet the plane (n,) [m]; infinite above the horizon."""
    across, down = np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(down > 0.0, height * across / down, np.inf))


def empty_graph(manifest: Manifest) -> LabeledGraph:
    """A graph without points, for a network with this manifest."""
    on_strips = manifest.mesh == "octaves"
    return LabeledGraph(
        np.full((1, 3), OFF_SCREEN, dtype=np.float32),
        np.zeros((1, 0 if on_strips else manifest.neighbors), dtype=np.int32),
        np.empty(0, dtype=np.int8),
        np.empty(0),
        np.empty((0, 2)),
        np.empty((0, 2), dtype=np.int32) if on_strips else None,
        np.empty((0, 5), dtype=np.float32) if manifest.peaks else None,
    )


def join_graphs(graphs: Sequence[LabeledGraph]) -> tuple[LabeledGraph, npt.NDArray[np.intp]]:
    """Several graphs as one with a single off-screen point, and where each begins (len(graphs) + 1,).

    Each keeps its own strips. The objects are left out.
    """
    starts = np.cumsum([0, *map(len, graphs)])
    last = int(starts[-1])
    neighbors = [
        np.where(each.neighbors[:-1] == len(each), last, each.neighbors[:-1] + start)
        for each, start in zip(graphs, starts, strict=False)
    ]
    off_screen = np.full((1, graphs[0].neighbors.shape[1]), last)
    cells = [each.cells for each in graphs if each.cells is not None]
    strips = np.cumsum([0, *(int(each[:, 1].max(initial=-1)) // STRIDE + 1 for each in cells)])
    apart = [each + np.array([0, STRIDE * strip], np.int32) for each, strip in zip(cells, strips, strict=False)]
    joined = LabeledGraph(
        np.concatenate([*(each.points[:-1] for each in graphs), graphs[0].points[-1:]]),
        np.concatenate([*neighbors, off_screen]).astype(np.int32),
        np.concatenate([each.labels for each in graphs]),
        np.concatenate([each.distances for each in graphs]),
        np.concatenate([each.pixels for each in graphs]),
        np.concatenate(apart) if apart else None,
    )
    return joined, starts
