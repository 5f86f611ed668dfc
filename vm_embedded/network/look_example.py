"""The self-test of a look network: stored patches, patches that are made of them, and the answers to all."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from ..arrays import Image, Singles
from ..errors import ModelError

ANSWERS = ("probability", "right", "down", "size")
"""Outputs of a look network for each class of a patch; see CloseLook.run."""

_MOST_MADE = 1000
"""Most patches that are made for a self-test."""


@dataclass(frozen=True, eq=False)
class LookTest:
    """Stored patches (k, size, size, 3), RGB, and answers to them and to n - k patches that are made of them.

    answers (n, C, 4): see CloseLook.run.
    """

    patches: Image
    answers: Singles

    def __len__(self) -> int:
        return len(self.answers)

    @property
    def all_patches(self) -> Image:
        """The patches (n, size, size, 3) of all answers."""
        return np.concatenate([self.patches, made_patches(self.patches, len(self.answers) - len(self.patches))])

    def as_dict(self) -> dict[str, Any]:
        """Text and nested lists for JSON."""
        return {
            "patches": base64.b64encode(np.ascontiguousarray(self.patches).tobytes()).decode(),
            "answers": np.round(self.answers.astype(float), 6).tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], size: int, classes: int) -> LookTest:
        """Inverse of `as_dict`, for patches of size x size samples and this number of classes. Raises ModelError."""
        try:
            answers = np.array(data["answers"], dtype=np.float32).reshape(-1, classes, len(ANSWERS))
            content = np.frombuffer(base64.b64decode(data["patches"], validate=True), dtype=np.uint8)
            patches = content.reshape(-1, size, size, 3)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ModelError(f"self-test of the close look can't be read: {error}") from error
        made = len(answers) - len(patches)
        if not 0 <= made <= (_MOST_MADE if len(patches) else 0):
            raise ModelError(
                f"self-test of the close look has {len(patches)} patches and {len(answers)} answers; it must have a "
                f"patch, and at most {_MOST_MADE} more answers than patches"
            )
        return cls(patches, answers)


def made_patches(patches: Image, count: int) -> Image:
    """Patches (count, size, size, 3): mixtures of two of these (k, size, size, 3), moved, with other sizes and colors.

    A network is unsure about many of them. Together they show changes of weights that the answers to the stored patches
    do not depend on. They are the same on every machine.
    """
    k, size = len(patches), patches.shape[1]
    colors = list(permutations(range(3)))
    made = np.empty((count, *patches.shape[1:]), dtype=np.uint8)
    for number in range(count):
        one, other = patches[number % k].astype(np.int32), patches[(number // 2 + 1) % k].astype(np.int32)
        share, zoom = (5 * number + 8) % 16, 1 + number % 3  # share in sixteenths
        mixed = ((16 - share) * one + share * other) // 16
        moved = np.roll(mixed, (7 * number % size, 11 * number % size), axis=(0, 1))
        rows = np.arange(size) // zoom if number % 2 else np.arange(size) * zoom % size
        scaled = moved[rows][:, rows][..., colors[number % len(colors)]]
        made[number] = 255 - scaled if number % 4 >= 2 else scaled
    return made
