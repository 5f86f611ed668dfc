"""Chooses rendered patches: those of the package, or a sample of the training of a look network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vm_embedded.errors import InputError
from vm_embedded.files import write_file
from vm_embedded.network.look_contract import LookContract

from ..look.labels import NOTHING, OBJECT
from ..look.patch_set import PatchChunk, PatchSet
from ..look.run import read_look_run
from .rendered_patches import RENDERED, write_rendered

_CLASS = "ball"
"""The object in the patches of the package."""

_COUNTS = {OBJECT: 2400, NOTHING: 3600}
"""Patches with and without an object in a sample; about as many as in six pictures of patches."""


def check_rendered(contract: LookContract, run: Path | None) -> None:
    """Raise InputError if there are no rendered patches for a look network with this contract.

    run: folder of the training of the look; None: the patches of the package are to be used.
    """
    if run is None and contract.object_class != _CLASS:
        raise InputError(
            f"the package has rendered patches of class {_CLASS!r}, but the close look judges "
            f"{contract.object_class!r}: give the folder of its vm-train look training with --rendered, so that the "
            "network does not forget what it has learned"
        )
    if run is not None and read_look_run(run).object_class != contract.object_class:
        raise InputError(
            f"{run} is the training of a look at {read_look_run(run).object_class!r}, not at {contract.object_class!r}"
        )


def write_rendered_for(path: Path, run: Path | None) -> None:
    """Write the rendered patches for a fine-tuning; see `check_rendered`. Raises InputError."""
    if run is not None:
        write_rendered(path, sample_run(run))
        return
    try:
        content = RENDERED.read_bytes()
    except OSError as error:
        raise InputError(f"can't read {RENDERED}: {error.strerror or error}") from error
    write_file(path, content)


def sample_run(folder: Path) -> PatchSet:
    """A sample of the training patches of a look network, always the same. Raises InputError."""
    run = read_look_run(folder)
    paths = sorted(run.patches.glob("*.npz"))
    if not paths:
        raise InputError(f"{run.patches} has no patches")
    random = np.random.default_rng(0)
    validation = np.isin(run.numbers, run.split.validation)
    chosen = []
    for path in paths:
        patches = PatchChunk.load(path).patches
        for label, count in _COUNTS.items():
            rows = np.flatnonzero((patches.labels == label) & ~validation[patches.pictures])
            chosen.append(patches.part(np.sort(random.permutation(rows)[: -(-count // len(paths))])))
    return PatchSet.joined(run.configuration.patches.size, chosen)
