"""Worker processes read pictures and turn them into graphs, ahead of the network that learns from them."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence

import numpy as np
from torch.utils.data import DataLoader, Dataset

from vm_embedded.errors import InputError, VisualMeshError
from vm_workstation.worker_process import interrupts_blocked, start_worker

from ..data.decoded_cache import DecodedCache, read_through_cache
from ..data.picture_files import PictureFiles
from ..data.pictures import Picture
from .graph_cache import GraphCache, rounded
from .graph_recipe import GraphRecipe
from .labeled_graph import LabeledGraph
from .schedule import Batch, Item


class PictureGraphs(Dataset[LabeledGraph]):
    """The graphs of pictures, by Item.

    decoded: cache of decoded pictures; views: cache of their views; None for no cache. Reading an item raises
    InputError if its picture can't be read.
    """

    def __init__(
        self,
        pictures: Sequence[PictureFiles],
        recipe: GraphRecipe,
        decoded: DecodedCache | None = None,
        views: GraphCache | None = None,
    ) -> None:
        self.pictures, self.recipe, self.decoded, self.views = tuple(pictures), recipe, decoded, views

    def __len__(self) -> int:
        return len(self.pictures)

    def __getitem__(self, item: Item) -> LabeledGraph:
        files = self.pictures[item.position]
        if self.views is None or item.seed is None:
            manifest = self.recipe.manifest_for(files)
            return self.recipe.make_graph(self._picture(files), manifest, item.seed, files.scene)
        random = np.random.default_rng(item.seed)
        view = int(random.integers(self.views.count))
        return self.recipe.draw_example(self._view(files, view, self.views), random)

    def _view(self, files: PictureFiles, view: int, views: GraphCache) -> LabeledGraph:
        """One of a picture's views from the cache; it is made and stored there if it is missing."""
        graph = views.get(files, view)
        if graph is None:
            manifest = self.recipe.manifest_for(files)
            random = views.random(files, view)
            graph = rounded(self.recipe.draw_view(self._picture(files), manifest, random, files.scene))
            views.put(files, view, graph)
        return graph

    def _picture(self, files: PictureFiles) -> Picture:
        return read_through_cache(files, self.recipe.classes, self.decoded)


def load_batches(
    graphs: Dataset[LabeledGraph], batches: Iterable[Batch], workers: int
) -> Generator[list[LabeledGraph]]:
    """The graphs of batches, in order, whatever the number of worker processes (0: this process reads).

    Raises the error that reading raised, and InputError if a worker was killed.
    """
    loader: DataLoader[list[LabeledGraph] | VisualMeshError] = DataLoader(
        _GraphsOrError(graphs),
        batch_sampler=(list(each.items) for each in batches),
        num_workers=workers,
        collate_fn=_unchanged,
        worker_init_fn=_start_worker,
        prefetch_factor=4 if workers else None,
        multiprocessing_context="spawn" if workers else None,
    )
    try:
        with interrupts_blocked():
            loaded = iter(loader)
        for found in loaded:
            if isinstance(found, VisualMeshError):
                raise found
            yield found
    except RuntimeError as error:
        if "DataLoader worker" not in str(error):
            raise
        raise InputError(
            "a worker process that reads pictures was killed, perhaps for lack of memory; try fewer --workers"
        ) from error


class _GraphsOrError(Dataset["list[LabeledGraph] | VisualMeshError"]):
    """The graphs of a batch, or the error that reading them raised.

    The error is returned, not raised: torch would replace its message by a worker's traceback.
    """

    def __init__(self, graphs: Dataset[LabeledGraph]) -> None:
        self._graphs = graphs

    def __getitems__(self, items: Sequence[Item]) -> list[LabeledGraph] | VisualMeshError:
        try:
            return [self._graphs[item] for item in items]
        except VisualMeshError as error:
            return error


def _unchanged(found: list[LabeledGraph] | VisualMeshError) -> list[LabeledGraph] | VisualMeshError:
    return found


def _start_worker(worker: int) -> None:
    start_worker()
