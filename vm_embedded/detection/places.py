"""Cutting the patches around places to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Image
from ..network.look_contract import LookContract
from .patches import Tangents, cut_patches, patch_nodes
from .prepared_view import PreparedView
from .pyramid import Pyramid


class Cut(NamedTuple):
    """Patches (k, size, size, 3), RGB, and their planes."""

    patches: Image
    tangents: Tangents


def cut_places(
    pyramid: Pyramid, views: Sequence[PreparedView], centers: Sequence[Floats], contracts: Sequence[LookContract]
) -> list[Cut]:
    """The patches around places of several classes, as their contracts describe them.

    Patches of one size are cut at once, which takes half the time. views: of the objects of each class, all of one
    camera. centers: (k, 3) of each class, relative to the camera in the mesh frame [m].
    """
    if not contracts:
        return []
    counts = [len(each) for each in centers]
    sizes, extents, halves = (
        np.repeat(each, counts)
        for each in (
            [each.size for each in contracts],
            [each.extent for each in contracts],
            [view.shape.half_size for view in views],
        )
    )
    tangents = Tangents.around(np.concatenate(centers), halves)
    nodes = patch_nodes(views[0], tangents, extents)
    ends = np.cumsum(counts)
    patches = {size: cut_patches(pyramid, nodes[:, sizes == size], size) for size in {each.size for each in contracts}}
    found = []
    for end, count, contract in zip(ends.tolist(), counts, contracts, strict=True):
        rows = slice(end - count, end)
        first = int(np.count_nonzero(sizes[: rows.start] == contract.size))
        found.append(Cut(patches[contract.size][first : first + count], tangents.part(rows)))
    return found
