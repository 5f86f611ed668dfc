"""Training pictures that are streamed from shards: nothing of them is kept on disk.

Readers, the worker processes of all processes of a training, have a lane each: in every epoch the shards are shuffled
and dealt to the lanes, and begin again where a lane has too few pictures. Which picture an item of a batch is follows
from the seed and the numbers of processes and workers that the training began with, so it goes on as it would have.
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
from .labeled_graph import LabeledGraph
from .loading import PictureGraphs, empty_graph
from .schedule import Batch, Item


@dataclass(frozen=True)
class StreamSource:
    """Where training pictures come from.

    shards: as shard_stream.stream takes them, but such as can begin again. epoch: pictures in an epoch. processes, and
    workers of each (0: it reads by itself), that the training began with. strict: a picture at fault ends it.
    Raises InputError if there are fewer shards than readers.
    """

    shards: tuple[str, ...]
    epoch: int
    processes: int
    workers: int
    strict: bool = False

    def __post_init__(self) -> None:
        if len(self.shards) < self.lanes:
            raise InputError(f"{self.lanes} processes that read need at least as many shards, not {len(self.shards)}")

    @property
    def lanes(self) -> int:
        """Readers, each with shards of its own."""
        return self.processes * max(self.workers, 1)


@dataclass(frozen=True)
class StreamedItem(Item):
    """A picture of the stream: its place in a lane when the shards are in the order that a seed gives."""

    order: tuple[int, ...] = ()
    lane: int = 0
    place: int = 0


def assign_lanes(batches: Iterable[Batch], seed: tuple[int, ...], source: StreamSource) -> Iterator[Batch]:
    """All batches of `schedule` with StreamedItems for training. Each worker finds its own lane in its batches."""
    places = Counter[tuple[int, int]]()
    for index, batch in enumerate(batches):
        if batch.validates:
            yield batch
            continue
        items = []
        for position, item in enumerate(batch.items):
            lane = index % max(source.workers, 1) * source.processes + position % source.processes
            place = places[batch.epoch, lane]
            items.append(StreamedItem(item.position, item.seed, (*seed, 4, batch.epoch), lane, place))
            places[batch.epoch, lane] += 1
        yield replace(batch, items=tuple(items))


class StreamedGraphs(Dataset[LabeledGraph]):
    """The graphs of a stream's pictures by StreamedItem, and those of the validation by Item, from source.epoch on.

    A picture at fault is named on standard error and has a graph without points, so that the others keep their places.
    Raises InputError if it must not be skipped, or a shard can't be read on.
    """

    def __init__(self, source: StreamSource, validation: PictureGraphs) -> None:
        self._source, self._validation = source, validation
        self._lanes: dict[int, _Lane] = {}
        self._named: set[str] = set()

    def __getitem__(self, item: Item) -> LabeledGraph:
        if not isinstance(item, StreamedItem):
            return self._validation[replace(item, position=item.position - self._source.epoch)]
        view, raw = self._validation.view, self._raw(item)
        try:
            picture = decode_picture(raw, view.classes, ("image", "mask", "lens"))
            return view.graph(picture, view.manifest, item.seed)
        except InputError as error:
            self._skip(InputError(f"picture {raw.number} of the stream: {error}"))
            return empty_graph(view.manifest.neighbors)

    def _raw(self, item: StreamedItem) -> RawPicture:
        lane = self._lanes.get(item.lane)
        if lane is None or lane.order != item.order or lane.done > item.place:
            pictures = _pictures(self._source, item.order, item.lane, self._skip)
            lane = self._lanes[item.lane] = _Lane(item.order, pictures)
        return lane.at(item.place)

    def _skip(self, fault: InputError) -> None:
        """Name a fault once. Raises it, if none is allowed."""
        if self._source.strict:
            raise InputError(f"{fault}; --strict allows none") from fault
        if str(fault) not in self._named:
            self._named.add(str(fault))
            print(f"vm-train: skipped: {' '.join(str(fault).split())}", file=sys.stderr)


class _Lane:
    """Pictures of a lane in an epoch, and how many of them were looked at or passed over."""

    def __init__(self, order: tuple[int, ...], pictures: Iterator[RawPicture]) -> None:
        self.order, self.done, self._pictures = order, 0, pictures

    def at(self, place: int) -> RawPicture:
        picture = next(islice(self._pictures, place - self.done, None))
        self.done = place + 1
        return picture


def _pictures(
    source: StreamSource, order: tuple[int, ...], lane: int, report: Callable[[PictureFault], None]
) -> Iterator[RawPicture]:
    """The pictures of a lane without end. Raises InputError if its shards have none."""
    for turn in count():
        seed = (*order, turn)
        shuffled = np.random.default_rng(seed).permutation(len(source.shards))
        own = [source.shards[each] for each in shuffled[lane :: source.lanes].tolist()]
        picture = None
        for picture in stream(own, (*seed, lane), report=report):
            yield picture
        if picture is None:
            raise InputError(f"no whole picture in {', '.join(own[:3])}" + " and so on" * (len(own) > 3))
