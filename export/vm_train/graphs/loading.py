"""Pictures read and turned into graphs by worker processes, ahead of the network that learns from them."""

from __future__ import annotations

import json
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from torch.utils.data import DataLoader, Dataset

from vm_embedded.detection.color_normalization import normalize_colors
from vm_embedded.errors import GeometryError, InputError, VisualMeshError
from vm_embedded.network.manifest import Manifest
from vm_export.grid import Grid
from vm_workstation.worker_process import begin, shielded

from ..data.classes import Classes
from ..data.decoded_cache import DecodedCache, read_through_cache
from ..data.picture_files import PictureFiles
from ..data.pictures import Picture
from .augmentation import Augmentation, perturb_camera, perturb_colors, perturb_sharpness
from .first_look import FirstLook
from .graph_cache import GraphCache
from .labeled_graph import OFF_SCREEN, LabeledGraph, graph_of
from .mirror import mirrored
from .schedule import Batch, Item
from .windows import random_window


@dataclass(frozen=True)
class GraphRecipe:
    """What makes a picture a graph: classes of the masks, the network's mesh and grid, and augmentation.

    own_radius: the mesh is made for the radius of each picture's own ball, as its sceneX.json has it. window: share of
    width and height that augmented pictures are cut to. first: passes on what the network sees, or None for all.
    mirrored: share of augmented pictures that are mirror images.
    """

    classes: Classes
    manifest: Manifest
    grid: Grid = field(default_factory=Grid)
    augmentation: Augmentation = field(default_factory=Augmentation)
    own_radius: bool = False
    window: float = 1.0
    first: FirstLook | None = None
    mirrored: float = 0.0

    def manifest_for(self, files: PictureFiles) -> Manifest:
        """The manifest with the radius of a picture's own ball, if asked for. Raises InputError."""
        return replace(self.manifest, radius=ball_radius(files)) if self.own_radius else self.manifest

    def graph(self, picture: Picture, manifest: Manifest, seed: tuple[int, ...] | None) -> LabeledGraph:
        """What a network with a manifest sees of a picture, augmented with a seed. Raises InputError."""
        if seed is None:
            return self._passed(self._plain(picture, manifest))
        random = np.random.default_rng(seed)
        return self.look(self.view(picture, manifest, random), random)

    def view(self, picture: Picture, manifest: Manifest, random: np.random.Generator) -> LabeledGraph:
        """The whole graph of a picture told to be from another pose and lens, and softened, in absolute colors.

        Raises InputError.
        """
        changed = perturb_sharpness(perturb_camera(picture, self.augmentation, random), self.augmentation, random)
        return self._plain(changed, replace(manifest, colors="absolute"))

    def look(self, graph: LabeledGraph, random: np.random.Generator) -> LabeledGraph:
        """A window of a view with other colors, or what the first network passes on of it."""
        objects = [at for at, each in enumerate(self.manifest.classes) if each.kind == "object"]
        colors = perturb_colors(graph.points[:-1], self.augmentation, random)
        normalize_colors(colors, self.manifest.colors)
        told = replace(graph, points=np.concatenate([colors, graph.points[-1:]]))
        seen = random_window(told, self.window, objects, random)
        if self.mirrored and random.random() < self.mirrored:  # where it is off, nothing more is drawn
            seen = mirrored(seen, self.manifest.model)
        return self._passed(seen)

    def _passed(self, graph: LabeledGraph) -> LabeledGraph:
        return graph if self.first is None else self.first.part(graph)

    def _plain(self, picture: Picture, manifest: Manifest) -> LabeledGraph:
        try:
            return graph_of(picture, manifest, self.grid)
        except GeometryError:  # so low a camera sees no points
            return empty_graph(manifest.neighbors)


def ball_radius(files: PictureFiles) -> float:
    """Radius of balls in a picture of vm-synth [m], also if it shows none. Raises InputError."""
    path = files.image.with_name(f"scene{files.number}.json")
    try:
        return float(json.loads(path.read_text(encoding="utf-8"))["ball_radius"])
    except OSError as error:
        raise InputError(f"{path.name}: says the ball's radius, but {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path.name}: does not say the ball's radius, ball_radius") from error


class PictureGraphs(Dataset[LabeledGraph]):
    """The graphs of pictures, by Item. Raises InputError for a picture that can't be read."""

    def __init__(
        self,
        pictures: Sequence[PictureFiles],
        view: GraphRecipe,
        unpacked: DecodedCache | None = None,
        views: GraphCache | None = None,
    ) -> None:
        self.pictures, self.view, self.unpacked, self.views = tuple(pictures), view, unpacked, views

    def __len__(self) -> int:
        return len(self.pictures)

    def __getitem__(self, item: Item) -> LabeledGraph:
        files = self.pictures[item.position]
        if self.views is None or item.seed is None:
            return self.view.graph(self._picture(files), self.view.manifest_for(files), item.seed)
        random = np.random.default_rng(item.seed)
        number = int(random.integers(self.views.count))
        graph = self.views.get(files, number)
        if graph is None:
            manifest = self.view.manifest_for(files)
            graph = self.view.view(self._picture(files), manifest, self.views.random(files, number))
            self.views.put(files, number, graph)
        return self.view.look(graph, random)

    def _picture(self, files: PictureFiles) -> Picture:
        return read_through_cache(files, self.view.classes, self.unpacked)


def empty_graph(neighbors: int) -> LabeledGraph:
    """A graph without points."""
    return LabeledGraph(
        np.full((1, 3), OFF_SCREEN, dtype=np.float32),
        np.zeros((1, neighbors), dtype=np.int32),
        np.empty(0, dtype=np.int8),
        np.empty(0),
        np.empty((0, 2)),
    )


def load_batches(
    graphs: Dataset[LabeledGraph], batches: Iterable[Batch], workers: int
) -> Generator[list[LabeledGraph]]:
    """The graphs of batches, in their order, whatever the number of worker processes (0: none).

    Raises what reading raised, and InputError if a worker was killed.
    """
    loader: DataLoader[list[LabeledGraph] | VisualMeshError] = DataLoader(
        _Faults(graphs),
        batch_sampler=(list(each.items) for each in batches),
        num_workers=workers,
        collate_fn=_as_they_are,
        worker_init_fn=_begin,
        prefetch_factor=4 if workers else None,
        multiprocessing_context="spawn" if workers else None,
    )
    try:
        with shielded():
            pictures = iter(loader)
        for found in pictures:
            if isinstance(found, VisualMeshError):
                raise found
            yield found
    except RuntimeError as error:
        if "DataLoader worker" not in str(error):
            raise
        raise InputError("a worker that read pictures was killed (out of memory?)") from error


class _Faults(Dataset["list[LabeledGraph] | VisualMeshError"]):
    """Graphs, or why there is none: an error that a worker raises would come with its traceback for a message."""

    def __init__(self, graphs: Dataset[LabeledGraph]) -> None:
        self._graphs = graphs

    def __getitems__(self, items: Sequence[Item]) -> list[LabeledGraph] | VisualMeshError:
        try:
            return [self._graphs[item] for item in items]
        except VisualMeshError as error:
            return error


def _as_they_are(found: list[LabeledGraph] | VisualMeshError) -> list[LabeledGraph] | VisualMeshError:
    return found


def _begin(worker: int) -> None:
    begin()
