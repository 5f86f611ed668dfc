"""Collecting patches from many pictures, in several processes and in files of some pictures each.

The number of processes does not change the result, nor does an interruption: finished files stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

from vm_workstation.worker_process import Work, results_of

from .patch_set import PatchChunk


def collect_chunks(
    items: Sequence[Work],
    make: Callable[[], Callable[[Work], PatchChunk]],
    size: int,
    folder: Path,
    workers: int,
    report: Callable[[int], None],
) -> list[Path]:
    """Collect the patches of all pictures, and return their files in `folder`, each a PatchChunk of `size` pictures.

    make: makes the function that collects from a picture. Files that are there stay. workers: processes; 1 uses only
    this process. report: is called with the number of pictures that are done. Raises what the function raises,
    InputError if a file can't be written, and VisualMeshError if a worker was killed.
    """
    starts = range(0, len(items), size)
    groups = {folder / f"{start // size:05d}.npz": items[start : start + size] for start in starts}
    missing = {path: group for path, group in groups.items() if not path.exists()}
    remaining = [item for group in missing.values() for item in group]
    done = len(items) - len(remaining)
    report(done)
    with closing(results_of(make, remaining, workers)) as results:
        for path, group in missing.items():
            parts = []
            for _ in group:
                parts.append(next(results))
                done += 1
                report(done)
            PatchChunk.joined(parts).save(path)
    return list(groups)
