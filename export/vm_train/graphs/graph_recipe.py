"""How a picture becomes a labeled graph: as it is for the validation, augmented for the training.

Augmentation has two steps. A view is the graph of the whole picture for one draw of camera error and sharpness;
graph_cache keeps some views of each picture on disk. An example is a view with another tone, cut to a window, perhaps
mirrored.

A window is a part of the picture. Most of a picture is grass. A window of half its width and height has a quarter of
the points, and most windows lie over an object. So the network sees several times as many objects in the same time. To
the network, a window is the picture of a camera with a smaller sensor. A mirror image doubles the pictures, because
nothing on a field depends on left and right.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vm_embedded.detection.sampling import normalized
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.files import read_regular
from vm_embedded.mesh.mesh import MeshModel
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid

from ..data.classes import Classes
from ..data.picture_files import PictureFiles
from ..data.pictures import Picture
from .augmentation import Augmentation, perturb_camera, perturb_colors, perturb_sharpness
from .labeled_graph import LabeledGraph, empty_graph, graph_of
from .true_places import TruePlace, true_places


@dataclass(frozen=True)
class GraphRecipe:
    """Everything besides the picture that decides its graph.

    own_radius: build the mesh for the radius of each picture's own ball, from its sceneX.json. window: share of width
    and height that examples are cut to. mirrored: share of examples that are mirror images.
    """

    classes: Classes
    manifest: Manifest
    grid: Grid = field(default_factory=Grid)
    augmentation: Augmentation = field(default_factory=Augmentation)
    own_radius: bool = False
    window: float = 1.0
    mirrored: float = 0.0

    def manifest_for(self, files: PictureFiles) -> Manifest:
        """The manifest, with the radius of the picture's own ball if own_radius is set. Raises InputError."""
        return replace(self.manifest, radius=ball_radius(files)) if self.own_radius else self.manifest

    def make_graph(
        self, picture: Picture, manifest: Manifest, seed: tuple[int, ...] | None, scene: Path | None = None
    ) -> LabeledGraph:
        """The graph of a picture: as it is without a seed, else augmented. scene: its scene file. Raises InputError."""
        if seed is None:
            return self._whole_graph(picture, manifest, self._places(picture, scene))
        random = np.random.default_rng(seed)
        return self.draw_example(self.draw_view(picture, manifest, random, scene), random)

    def draw_view(
        self, picture: Picture, manifest: Manifest, random: np.random.Generator, scene: Path | None = None
    ) -> LabeledGraph:
        """The whole graph of a picture with random camera error and blur, in absolute colors. Raises InputError.

        scene: the picture's scene file.
        """
        places = self._places(picture, scene)
        changed = perturb_sharpness(perturb_camera(picture, self.augmentation, random), self.augmentation, random)
        # Without normalized colors: draw_example first changes the tone, then normalizes.
        return self._whole_graph(changed, replace(manifest, colors="absolute"), places)

    def draw_example(self, view: LabeledGraph, random: np.random.Generator) -> LabeledGraph:
        """A random window of a view in a random tone, perhaps mirrored."""
        objects = [at for at, each in enumerate(self.manifest.classes) if each.kind == "object"]
        colors = perturb_colors(view.points[:-1], self.augmentation, random)
        colors = normalized(colors.T, self.manifest.colors, view.counted).T
        off_screen = view.points[-1:]  # the last row; its color is fixed
        colored = replace(view, points=np.concatenate([colors, off_screen]))
        seen = random_window(colored, self.window, objects, random)
        return mirror_image(seen, self.manifest.model) if random.random() < self.mirrored else seen

    def _places(self, picture: Picture, scene: Path | None) -> list[TruePlace]:
        """The places of a picture's objects: a camera error moves none of them. None for a network without peaks."""
        return true_places(picture, scene, self.manifest) if self.manifest.peaks else []

    def _whole_graph(self, picture: Picture, manifest: Manifest, places: Sequence[TruePlace]) -> LabeledGraph:
        try:
            return graph_of(picture, manifest, self.grid, places)
        except GeometryError:  # the camera is too low to see any point of the mesh
            return empty_graph(manifest)


def ball_radius(files: PictureFiles) -> float:
    """Radius [m] of the balls in a picture of vm-synth, even if it shows none. Raises InputError."""
    path = files.scene
    try:
        radius = float(json.loads(read_regular(path))["ball_radius"])
    except OSError as error:
        raise InputError(f"can't read the ball's radius from {path.name}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path.name} has no number ball_radius, the ball's radius [m]") from error
    if not 0.0 < radius < math.inf:
        raise InputError(f"{path.name}: ball_radius must be a number above 0, the ball's radius [m], not {radius:g}")
    return radius


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
