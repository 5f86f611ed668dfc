"""Views of pictures on disk, because a small network learns from a graph in less time than it takes to make one.

graph_recipe says what a view is. Windows, mirror images and tones are drawn anew for each example. A file holds a
header, then neighbors, colors, pixels, distances, labels and, without neighbors, cells and objects as raw arrays.
Colors are float16: half the bytes to read, with an error of at most 0.00025, far below a level of an 8-bit picture
(0.0039). Trainings share the views that they would make in the same way.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import struct
import zlib
from dataclasses import asdict
from pathlib import Path
from urllib.parse import quote

import numpy as np

from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write, read_regular

from ..data.decoded_cache import KEPT_FREE, MAGIC, fingerprint, remove_entries
from ..data.picture_files import PictureFiles
from .graph_recipe import GraphRecipe
from .labeled_graph import LabeledGraph

_HEADER = struct.Struct("<8s32sIII")  # magic, fingerprint of the picture's files, points, neighbors of each, objects
_MAGIC = b"vmviews2"
_OF_MESH = ("shape", "radius", "object_height", "intersections", "mesh", "max_distance", "sampling", "peaks")
"""Entries of a manifest that decide the points of a view."""


class GraphCache:
    """`count` views of each picture, counted from 0, in a subfolder for all recipes that make the same views.

    Stale and damaged files count as absent. Raises InputError if the folder can't be made.
    """

    def __init__(self, folder: Path, count: int, recipe: GraphRecipe) -> None:
        self.count = count
        self._classes = recipe.classes
        self._peaks = bool(recipe.manifest.peaks)
        mesh = {name: getattr(recipe.manifest, name) for name in _OF_MESH}
        decisive = [mesh, asdict(recipe.grid), asdict(recipe.augmentation), recipe.own_radius]
        digest = hashlib.sha256(json.dumps(decisive, sort_keys=True).encode()).hexdigest()
        self._folder = folder / f"views-{digest[:12]}"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"can't use folder {self._folder}: {error.strerror or error}") from error

    def random(self, files: PictureFiles, view: int) -> np.random.Generator:
        """The random numbers of a picture's view, the same in every training."""
        return np.random.default_rng([view, zlib.crc32(files.number.encode("utf-8", "surrogateescape"))])

    def get(self, files: PictureFiles, view: int) -> LabeledGraph | None:
        """A view, or None if it is absent or older than its picture's files."""
        try:
            content = read_regular(self._path(files, view))
            magic, source, points, neighbors, objects = _HEADER.unpack_from(content)
            if magic != _MAGIC or source != fingerprint(files, self._classes):
                return None
            read = _Reader(content, _HEADER.size)
            graph = LabeledGraph(
                neighbors=read.array(np.int32, (points + 1, neighbors)),
                points=read.array(np.float16, (points + 1, 3)).astype(np.float32),
                pixels=read.array(np.float32, (points, 2)),
                distances=read.array(np.float32, (points,)),
                labels=read.array(np.int8, (points,)),
                cells=None if neighbors else read.array(np.int32, (points, 2)),
                objects=read.array(np.float32, (objects, 5)) if self._peaks else None,
            )
        except (OSError, ValueError, struct.error):
            return None
        return graph if read.place == len(content) else None

    def put(self, files: PictureFiles, view: int, graph: LabeledGraph) -> None:
        """Store a view, as `rounded` returns it. Without effect if it can't be written."""
        try:
            if shutil.disk_usage(self._folder).free < KEPT_FREE:
                return
            more = [each for each in (graph.cells, graph.objects) if each is not None]
            sizes = len(graph), graph.neighbors.shape[1], 0 if graph.objects is None else len(graph.objects)
            header = _HEADER.pack(_MAGIC, fingerprint(files, self._classes), *sizes)
            parts = (graph.neighbors, graph.points.astype(np.float16), graph.pixels, graph.distances, graph.labels)
            with atomic_write(self._path(files, view)) as part, part.open("wb") as file:
                for each in (header, *(array.tobytes() for array in (*parts, *more))):
                    file.write(each)
        except (OSError, InputError):
            return  # the next training example makes it again

    def _path(self, files: PictureFiles, view: int) -> Path:
        return self._folder / f"{quote(files.number, safe='')}-{view}.raw"


def remove_caches(folder: Path) -> None:
    """Remove all views and decoded pictures in a folder, and the folder itself unless it has other files."""
    for views in folder.glob("views-*"):
        if not views.is_symlink():
            remove_entries(views, _MAGIC)
    remove_entries(folder, MAGIC)


def rounded(graph: LabeledGraph) -> LabeledGraph:
    """The graph with the digits that the cache keeps, so that a training does not depend on what the cache holds."""
    return LabeledGraph(
        neighbors=graph.neighbors.astype(np.int32),
        points=graph.points.astype(np.float16).astype(np.float32),
        pixels=graph.pixels.astype(np.float32),
        distances=graph.distances.astype(np.float32),
        labels=graph.labels,
        cells=graph.cells,
        objects=graph.objects,
    )


class _Reader:
    """Reads arrays one after the other from a file's content."""

    def __init__(self, content: bytes, place: int) -> None:
        self._content, self.place = content, place

    def array(self, kind: type[np.generic], shape: tuple[int, ...]) -> np.ndarray:
        """The next array. Raises ValueError if the content ends before it does."""
        count = int(np.prod(shape))
        found = np.frombuffer(self._content, kind, count, self.place).reshape(shape)
        self.place += found.nbytes
        return found
