"""Training pictures streamed from shards; nothing is stored on disk.

Each reader (a worker process of any of the training's processes) has its own lane of shards. Every epoch shuffles the
shards and deals them to the lanes; a lane that runs out of pictures begins again. The seed and the numbers of processes
and workers at the beginning decide which picture each item is, so a resumed training sees the same pictures.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np
from torch.utils.data import Dataset

from vm_embedded.errors import InputError

from ..data.picture_files import PictureFault, RawPicture
from ..data.pictures import decode_picture
from ..data.shard_stream import stream
from .labeled_graph import LabeledGraph, empty_graph
from .loading import PictureGraphs
from .schedule import Batch, Item

_STREAM = 4
"""Keeps the random numbers of the order of shards apart from others with the same seed; see schedule.py."""


@dataclass(frozen=True)
class StreamSource:
    """Where streamed training pictures come from. run.json keeps these entries.

    shards: for shard_stream.stream; each must be readable more than once. epoch: pictures in an epoch. processes,
    workers: of the training when it began; workers of each process, 0 if the process reads by itself. strict: a damaged
    picture ends the training. Raises InputError if there are fewer shards than readers.
    """

    shards: tuple[str, ...]
    epoch: int
    processes: int
    workers: int
    strict: bool = False

    def __post_init__(self) -> None:
        if len(self.shards) < self.lanes:
            raise InputError(
                f"{self.lanes} reading processes need at least {self.lanes} shards, not {len(self.shards)}"
            )

    @property
    def lanes(self) -> int:
        """Number of readers, each with its own shards."""
        return self.processes * max(self.workers, 1)


@dataclass(frozen=True)
class StreamedItem(Item):
    """A picture of the stream: its place in a lane, when the seed `order` has shuffled the shards."""

    order: tuple[int, ...] = ()
    lane: int = 0
    place: int = 0


def assign_lanes(batches: Iterable[Batch], seed: tuple[int, ...], source: StreamSource) -> Iterator[Batch]:
    """The batches of `schedule`, with StreamedItems for training. A worker's batches are all in its own lane."""
    places = Counter[tuple[int, int]]()
    for index, batch in enumerate(batches):
        if batch.validates:
            yield batch
            continue
        items = []
        for position, item in enumerate(batch.items):
            # The loader deals batches to its workers in turn, and Batch.part deals items to the processes.
            lane = index % max(source.workers, 1) * source.processes + position % source.processes
            place = places[batch.epoch, lane]
            items.append(StreamedItem(item.position, item.seed, (*seed, _STREAM, batch.epoch), lane, place))
            places[batch.epoch, lane] += 1
        yield replace(batch, items=tuple(items))


class StreamedGraphs(Dataset[LabeledGraph]):
    """Graphs of streamed pictures by StreamedItem, and of validation pictures by Item, at positions from source.epoch.

    A damaged picture is reported once on standard error and becomes a graph without points, so the others keep their
    places. Reading an item raises InputError if `strict` forbids that, or if a shard can't be read to its end.
    """

    def __init__(self, source: StreamSource, validation: PictureGraphs) -> None:
        self._source, self._validation = source, validation
        self._lanes: dict[int, _Lane] = {}
        self._named: set[str] = set()

    def __getitem__(self, item: Item) -> LabeledGraph:
        if not isinstance(item, StreamedItem):
            return self._validation[replace(item, position=item.position - self._source.epoch)]
        recipe, raw = self._validation.recipe, self._raw(item)
        try:
            picture = decode_picture(raw, recipe.classes, ("image", "mask", "lens"))
            return recipe.make_graph(picture, recipe.manifest, item.seed)
        except InputError as error:
            self._skip(InputError(f"picture {raw.number} of the stream: {error}"))
            return empty_graph(recipe.manifest)

    def _raw(self, item: StreamedItem) -> RawPicture:
        """Read on in the item's lane. Begins the lane again for another epoch, or a place that is passed already."""
        lane = self._lanes.get(item.lane)
        if lane is None or lane.order != item.order or lane.done > item.place:
            pictures = _pictures(self._source, item.order, item.lane, self._skip)
            lane = self._lanes[item.lane] = _Lane(item.order, pictures)
        return lane.at(item.place)

    def _skip(self, fault: InputError) -> None:
        """Report a fault once. Raises InputError if --strict is given."""
        if self._source.strict:
            raise InputError(f"{fault}; with --strict, a damaged picture ends the training") from fault
        if str(fault) not in self._named:
            self._named.add(str(fault))
            print(f"vm-train: skipped: {' '.join(str(fault).split())}", file=sys.stderr)


class _Lane:
    """Pictures of a lane in an epoch. done: how many of them were read or passed over."""

    def __init__(self, order: tuple[int, ...], pictures: Iterator[RawPicture]) -> None:
        self.order, self.done, self._pictures = order, 0, pictures

    def at(self, place: int) -> RawPicture:
        picture = next(islice(self._pictures, place - self.done, None))
        self.done = place + 1
        return picture


def _pictures(
    source: StreamSource, order: tuple[int, ...], lane: int, report: Callable[[PictureFault], None]
) -> Iterator[RawPicture]:
    """The pictures of a lane, endlessly. Raises InputError if its shards hold no complete picture."""
    for turn in count():
        seed = (*order, turn)
        shuffled = np.random.default_rng(seed).permutation(len(source.shards))
        own = [source.shards[each] for each in shuffled[lane :: source.lanes].tolist()]
        picture = None
        for picture in stream(own, (*seed, lane), report=report):
            yield picture
        if picture is None:
            raise InputError(f"no complete picture in {', '.join(own[:3])}" + " and other shards" * (len(own) > 3))
