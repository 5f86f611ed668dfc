"""Labeled patches, and the files that hold them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Image, Singles
from vm_embedded.errors import InputError, one_line
from vm_embedded.files import atomic_write

from ..data.array_files import read_arrays
from .labels import OBJECT

_NAMES = ("patches", "labels", "targets", "kinds", "pictures")
"""Arrays of a set, in order."""


@dataclass(frozen=True, eq=False)
class PatchSet:
    """n labeled patches.

    patches (n, size, size, 3): RGB. labels (n,): NOTHING or OBJECT. targets (n, 3): see PlaceLabels. kinds (n,):
    number of the class that these are about. pictures (n,): positions of their pictures in the run's list.
    """

    patches: Image
    labels: npt.NDArray[np.int8]
    targets: Singles
    kinds: npt.NDArray[np.int8]
    pictures: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.labels)

    @property
    def objects(self) -> int:
        """Number of patches that show an object."""
        return int((self.labels == OBJECT).sum())

    def part(self, chosen: npt.NDArray[Any]) -> PatchSet:
        """The patches of a mask (n,), or with these positions."""
        return PatchSet(*(each[chosen] for each in self.arrays()))

    def sha256(self) -> str:
        """Digest of everything in the set."""
        digest = hashlib.sha256()
        for each in self.arrays():
            digest.update(np.ascontiguousarray(each).data)
        return digest.hexdigest()

    @classmethod
    def empty(cls, size: int, count: int = 0) -> PatchSet:
        """A set of `count` patches that are yet to be written."""
        return cls(
            np.empty((count, size, size, 3), dtype=np.uint8),
            np.zeros(count, dtype=np.int8),
            np.zeros((count, 3), dtype=np.float32),
            np.zeros(count, dtype=np.int8),
            np.zeros(count, dtype=np.int32),
        )

    def write(self, start: int, other: PatchSet) -> int:
        """Replace the patches from position `start` on by those of another set. Returns the position after them."""
        end = start + len(other)
        for target, source in zip(self.arrays(), other.arrays(), strict=True):
            target[start:end] = source
        return end

    @classmethod
    def joined(cls, size: int, sets: Sequence[PatchSet]) -> PatchSet:
        """All patches of several sets, in order."""
        made = cls.empty(size, sum(map(len, sets)))
        start = 0
        for each in sets:
            start = made.write(start, each)
        return made

    def arrays(self) -> tuple[npt.NDArray[Any], ...]:
        """All arrays, in the order of the fields."""
        return self.patches, self.labels, self.targets, self.kinds, self.pictures


@dataclass(frozen=True, eq=False)
class PatchChunk:
    """What was collected from some pictures.

    truths (C, 2): for each class, the number of visible true objects in validation pictures, and of these that some
    proposal is at. faults: the reason for each picture that can't be used.
    """

    patches: PatchSet
    truths: npt.NDArray[np.int64]
    faults: tuple[str, ...] = ()

    @classmethod
    def joined(cls, parts: Sequence[PatchChunk]) -> PatchChunk:
        """All of several chunks, at least one, in order."""
        return cls(
            PatchSet.joined(parts[0].patches.patches.shape[1], [each.patches for each in parts]),
            np.sum([each.truths for each in parts], axis=0),
            tuple(fault for each in parts for fault in each.faults),
        )

    def save(self, path: Path) -> None:
        """Write the chunk. Raises InputError if it can't be written."""
        arrays: dict[str, Any] = dict(zip(_NAMES, self.patches.arrays(), strict=True))
        arrays |= {"truths": self.truths, "faults": np.array(self.faults, dtype=np.str_)}
        with atomic_write(path) as part, part.open("wb") as file:
            np.savez(file, **arrays)

    @classmethod
    def load(cls, path: Path) -> PatchChunk:
        """Read a chunk. Raises InputError naming the file."""
        try:
            file = read_arrays(path)
            truths = file["truths"].reshape(-1, 2)
            return cls(PatchSet(*(file[name] for name in _NAMES)), truths, tuple(map(str, file["faults"])))
        except InputError as error:
            raise InputError(f"{error}; remove it and resume the training") from error
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"can't read {path}: {one_line(error)}; remove it and resume the training") from error
