"""What a training looks at, and when: nothing but the seed and the numbers of pictures decide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

_VALIDATED = 8  # pictures at once


@dataclass(frozen=True)
class Item:
    """A picture to be loaded: its position in the set, and the seed of its augmentation; None for none."""

    position: int
    seed: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Batch:
    """Pictures of one step of training, or of a part of the validation after an epoch.

    step: number of steps that are done after it, or that were done before the validation. last: of its epoch's
    training, or of its validation.
    """

    epoch: int
    step: int
    items: tuple[Item, ...]
    validates: bool
    last: bool

    def part(self, rank: int, size: int) -> Batch:
        """What one of `size` processes has to do of it."""
        return Batch(self.epoch, self.step, self.items[rank::size], self.validates, self.last)


def steps_an_epoch(training: int, batch: int) -> int:
    """Steps in which `training` pictures are looked at once."""
    return -(-training // batch)


def schedule(
    seed: tuple[int, ...], epochs: int, batch: int, training: int, validation: int, looks: int = 1
) -> Iterator[Batch]:
    """All batches of a training: in each epoch all pictures, shuffled, `looks` times, then all of the validation.

    Positions from 0 are those of the training pictures, and from `training` on those of the validation.
    """
    step = 0
    for epoch in range(epochs):
        random = np.random.default_rng([*seed, 1, epoch])
        shuffled = np.concatenate([random.permutation(training) for _ in range(looks)])
        starts = range(0, len(shuffled), batch)
        for start in starts:
            step += 1
            chosen = shuffled[start : start + batch].tolist()
            items = tuple(Item(each, (*seed, 3, epoch, start + place)) for place, each in enumerate(chosen))
            yield Batch(epoch, step, items, validates=False, last=start == starts[-1])
        for start in range(0, validation, _VALIDATED):
            end = min(start + _VALIDATED, validation)
            items = tuple(Item(each) for each in range(training + start, training + end))
            yield Batch(epoch, step, items, validates=True, last=end == validation)
