"""Which pictures a training uses in which step. Only the seed and the numbers of pictures decide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

_VALIDATED = 8  # pictures in a batch of the validation

_ORDER, _AUGMENTATION = 1, 3
"""Keep random numbers of different uses apart that begin with the same seed; 2 is `_DRAWS` of learning/trainer.py."""


@dataclass(frozen=True)
class Item:
    """A picture to load: its position in the set, and the seed of its augmentation; None for no augmentation."""

    position: int
    seed: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Batch:
    """Pictures of one training step, or one part of the validation after an epoch.

    step: for training, the number of this step, from 1; for validation, the number of the last step before it. last:
    whether it ends its epoch's training, or the validation.
    """

    epoch: int
    step: int
    items: tuple[Item, ...]
    validates: bool
    last: bool

    def part(self, rank: int, size: int) -> Batch:
        """The share of one of `size` processes."""
        return Batch(self.epoch, self.step, self.items[rank::size], self.validates, self.last)


def steps_an_epoch(training: int, batch: int) -> int:
    """Number of steps that look once at each of `training` pictures."""
    return -(-training // batch)


def schedule(
    seed: tuple[int, ...], epochs: int, batch: int, training: int, validation: int, repeats: int = 1
) -> Iterator[Batch]:
    """All batches of a training: each epoch uses all pictures `repeats` times, shuffled, and then validates.

    training, validation: numbers of pictures. Positions below `training` are training pictures; the `validation`
    positions after them are validation pictures.
    """
    step = 0
    for epoch in range(epochs):
        random = np.random.default_rng([*seed, _ORDER, epoch])
        shuffled = np.concatenate([random.permutation(training) for _ in range(repeats)])
        starts = range(0, len(shuffled), batch)
        for start in starts:
            step += 1
            chosen = shuffled[start : start + batch].tolist()
            items = tuple(Item(each, (*seed, _AUGMENTATION, epoch, start + place)) for place, each in enumerate(chosen))
            yield Batch(epoch, step, items, validates=False, last=start == starts[-1])
        for start in range(0, validation, _VALIDATED):
            end = min(start + _VALIDATED, validation)
            items = tuple(Item(each) for each in range(training + start, training + end))
            yield Batch(epoch, step, items, validates=True, last=end == validation)
