"""Pictures read and turned into graphs by worker processes, ahead of the network that learns from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from torch.utils.data import DataLoader, Dataset

from vm_embedded.manifest import Manifest

from .graphs import Graph, graph_of
from .pictures import Classes, PictureFiles, read_picture
from .training import Item


class Graphs(Dataset[Graph]):
    """The graphs of pictures, by Item. Raises InputError for a picture that can't be read."""

    def __init__(self, pictures: Sequence[PictureFiles], classes: Classes, manifest: Manifest) -> None:
        self._pictures, self._classes, self._manifest = list(pictures), classes, manifest

    def __len__(self) -> int:
        return len(self._pictures)

    def __getitem__(self, item: Item) -> Graph:
        return graph_of(read_picture(self._pictures[item.position], self._classes), self._manifest)


def loaded(graphs: Graphs, batches: list[list[Item]], workers: int) -> Iterable[list[Graph]]:
    """The graphs of batches, in their order, whatever the number of worker processes (0: none)."""
    return DataLoader(
        graphs,
        batch_sampler=batches,
        num_workers=workers,
        collate_fn=list,
        multiprocessing_context="spawn" if workers else None,
    )
