"""From a labeled picture to the graph that a network learns from: colored points, their neighbors and labels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Indices, Singles
from vm_embedded.detection.color_normalization import normalize_colors
from vm_embedded.detection.footprint import Levels, footprint_levels, uniform_levels
from vm_embedded.detection.projection import Projection, along, project
from vm_embedded.detection.sampling import sample
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.manifest import Manifest
from vm_export.grid import VISUAL, Grid

from ..data.classes import Labels
from ..data.pictures import Picture
from .hexagonal import ROW, HexagonalMesh, hexagonal_mesh, visible_hexagonal_mesh

OFF_SCREEN = -1.0
"""Color of the off-screen point."""


@dataclass(frozen=True)
class LabeledGraph:
    """n points of one picture, or of several joined.

    points (n + 1, 3): colors, RGB from 0 to 1; row n is the off-screen point. neighbors (n + 1, N): rows of points.
    labels (n,): positions of classes, -1 for unlabeled. distances (n,): along the plane, from the camera to an object
    at the point [m]. pixels (n, 2): places of the points in their pictures, (x, y) [px].
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


def seen_points(lens: LensFile, size: Size, manifest: Manifest, grid: Grid = VISUAL) -> Projection[Mesh]:
    """The points that a network gets of a picture: on screen all of them, rays in the observation-plane frame.

    The lens file must hold an orientation. Raises GeometryError if the camera is too low for a mesh, and InputError if
    the lens does not fit the picture or sees none of it.
    """
    orientation = lens.orientation
    assert orientation is not None  # read_picture checked it
    fitted = lens.lens.for_image(size)
    mesh = manifest.model.build(manifest.mesh_shape, orientation.height, manifest.intersections, manifest.max_distance)
    mesh = _near_picture(mesh, orientation.level, fitted, size)
    if grid.kind == "visual":
        return project(mesh, orientation.level, fitted, size).visible
    if grid.equal_at:
        flat = _equal_hexagonal_mesh(fitted, size, manifest, orientation.height, grid.equal_at)
    else:
        count = np.count_nonzero(project(mesh, orientation.level, fitted, size).on_screen)
        flat = visible_hexagonal_mesh(fitted, size, max(int(count), 1))
    rays = np.asarray(fitted.unproject(flat.pixels, size) @ orientation.level.T)
    return Projection(Mesh(rays, flat.neighbors), flat.pixels, np.ones(len(flat), dtype=bool))


def _near_picture(mesh: Mesh, rotation: Floats, lens: Lens, size: Size) -> Mesh:
    """The part of a mesh in the cone around the picture's middle ray that contains the picture: less to project.

    rotation (3, 3): camera to mesh frame. Returns the whole mesh if the picture covers a hemisphere or more, or if the
    lens does not see the whole border.
    """
    x, y = np.linspace(0.0, size[0] - 1.0, 17), np.linspace(0.0, size[1] - 1.0, 17)
    sides = [np.stack(np.broadcast_arrays(x, at), axis=1) for at in (0.0, size[1] - 1.0)]
    sides += [np.stack(np.broadcast_arrays(at, y), axis=1) for at in (0.0, size[0] - 1.0)]
    middle = np.array([[size[0] - 1.0, size[1] - 1.0]]) / 2.0
    axis, *border = lens.unproject(np.concatenate([middle, *sides]), size)
    # Between two of these pixels the border may reach a little farther.
    reach = 1.05 * float(np.arccos(np.clip(np.stack(border) @ axis, -1.0, 1.0)).max()) + 0.01
    if not reach < math.pi / 2.0:  # NaN if the lens does not see part of the border
        return mesh
    return mesh.part(np.flatnonzero(along(mesh.rays, rotation @ axis) > math.cos(reach)))


def _equal_hexagonal_mesh(lens: Lens, size: Size, manifest: Manifest, height: float, distance: float) -> HexagonalMesh:
    """A mesh with as many points on an object at a distance [m] as the Visual Mesh has.

    The Visual Mesh has k^2 points on the square around an object. The object's size in the picture is that on the
    lens's axis.
    """
    radius = manifest.radius
    away = math.hypot(distance, height - manifest.mesh_shape.center_height)
    step = 1e-4  # [rad]
    axis = np.array([[1.0, 0.0, 0.0], [1.0, step, 0.0], [1.0, 0.0, step]])
    middle, left, up = lens.project(axis / np.linalg.norm(axis, axis=1, keepdims=True), size)
    scale = math.sqrt(abs(float(np.linalg.det(np.stack([left - middle, up - middle]))))) / step  # [px/rad]
    cell = (2.0 * radius / away * scale / manifest.intersections) ** 2  # [px^2] for each point
    spacing = math.sqrt(cell / ROW)
    count = max(round((size[0] - 1.0) * (size[1] - 1.0) / (spacing**2 * ROW)), 1)
    mesh = hexagonal_mesh(size, count)
    return mesh.part(np.flatnonzero(mesh.on_screen(lens, size)))


def graph_of(picture: Picture, manifest: Manifest, grid: Grid = VISUAL) -> LabeledGraph:
    """The graph of a picture for a network with this manifest. Raises GeometryError or InputError as seen_points."""
    height, width = picture.labels.shape
    shown = seen_points(picture.lens, (width, height), manifest, grid)
    points = np.full((len(shown) + 1, 3), OFF_SCREEN, dtype=np.float32)
    levels = levels_for(picture, shown.graph.rays, manifest, grid)
    sample(picture.image, shown.pixels, "bgr", "exact", points[:-1], levels)
    normalize_colors(points[:-1], manifest.colors)
    x, y = np.rint(shown.pixels).astype(np.intp).T
    assert picture.lens.orientation is not None
    distances = plane_distances(shown.graph.rays, picture.lens.orientation.height)
    return LabeledGraph(points, shown.graph.neighbors, picture.labels[y, x], distances, shown.pixels)


def levels_for(picture: Picture, rays: Floats, manifest: Manifest, grid: Grid) -> Levels | None:
    """The points with rays (n, 3) that each halved picture colors, or None if the network samples single pixels."""
    height, width = picture.labels.shape
    if grid.kind == VISUAL.kind:
        assert picture.lens.orientation is not None
        lens = picture.lens.lens.for_image((width, height))
        return footprint_levels(manifest, rays, picture.lens.orientation.height, lens)
    if manifest.sampling == "bilinear":
        return None
    return uniform_levels(len(rays), math.sqrt(height * width / max(len(rays), 1)))


def plane_distances(rays: Floats, height: float) -> Floats:
    """Distance from the camera's foot to where rays (n, 3) meet the plane (n,) [m]; infinite above the horizon."""
    across, down = np.hypot(rays[:, 0], rays[:, 1]), -rays[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(down > 0.0, height * across / down, np.inf))


def empty_graph(neighbors: int) -> LabeledGraph:
    """A graph without points, whose off-screen point has that many neighbors."""
    return LabeledGraph(
        np.full((1, 3), OFF_SCREEN, dtype=np.float32),
        np.zeros((1, neighbors), dtype=np.int32),
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
