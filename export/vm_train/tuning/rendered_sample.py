"""Chooses rendered patches: those of the package, or a sample of the training of a look network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vm_embedded.errors import InputError
from vm_embedded.files import write_file

from ..look.labels import NOTHING, OBJECT
from ..look.patch_set import PatchChunk, PatchSet
from ..look.run import read_look_run
from .rendered_patches import RENDERED, rendered_names, write_rendered

_COUNTS = {OBJECT: 1600, NOTHING: 2400}
"""Patches of a class with and without an object in a sample; with a quarter of them of two other classes, these are
about as many as in six pictures of patches."""

_OTHERS = 4
"""Classes after the first one have one of so many patches."""


def check_rendered(name: str, run: Path | None) -> None:
    """Raise InputError if there are no rendered patches of a class.

    run: folder of the training of the look; None: the patches of the package are to be used.
    """
    if run is None and name not in (known := rendered_names(RENDERED)):
        raise InputError(
            f"the package has rendered patches of {', '.join(known)}, but the close look judges {name!r}: give the "
            "folder of its vm-train look training with --rendered, so that the network does not forget what it has "
            "learned"
        )
    if run is not None and name not in (judged := read_look_run(run).classes):
        raise InputError(f"{run} is the training of a look at {', '.join(judged)}, not at {name!r}")


def write_rendered_for(path: Path, run: Path | None) -> None:
    """Write the rendered patches for a fine-tuning; see `check_rendered`. Raises InputError."""
    if run is not None:
        write_sample(path, run)
        return
    try:
        content = RENDERED.read_bytes()
    except OSError as error:
        raise InputError(f"can't read {RENDERED}: {error.strerror or error}") from error
    write_file(path, content)


def write_sample(path: Path, folder: Path) -> None:
    """Write a sample of the training patches of a look network, always the same. Raises InputError."""
    run = read_look_run(folder)
    paths = sorted(run.patches.glob("*.npz"))
    if not paths:
        raise InputError(f"{run.patches} has no patches")
    random = np.random.default_rng(0)
    validation = np.isin(run.numbers, run.split.validation)
    chosen = []
    for each in paths:
        patches = PatchChunk.load(each).patches
        for kind in range(len(run.classes)):
            for label, count in _COUNTS.items():
                wanted = count // _OTHERS if kind else count
                rows = (patches.labels == label) & (patches.kinds == kind) & ~validation[patches.pictures]
                kept = random.permutation(np.flatnonzero(rows))[: -(-wanted // len(paths))]
                chosen.append(patches.part(np.sort(kept)))
    write_rendered(path, PatchSet.joined(run.configuration.patches.size, chosen), run.classes)
