"""The pictures of a training, for training or validation, read in batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vm_embedded.errors import InputError

from ..data.decoded_cache import DecodedCache
from ..data.pictures import find_pictures
from ..data.split import Split
from ..graphs.graph_cache import GraphCache
from ..graphs.graph_recipe import GraphRecipe
from ..graphs.loading import PictureGraphs
from ..graphs.schedule import Batch, Item, schedule
from .configuration import TrainConfiguration
from .recipe import Recipe

_COUNTED = 300
"""Pictures whose points are counted by class."""


@dataclass(frozen=True)
class TrainingData:
    """Which pictures a training uses, and for what.

    folder: of the pictures. split: numbers of those for training, validation and test. unpacked: folder for decoded
    pictures and views, or None for no cache.
    """

    folder: Path
    split: Split
    unpacked: Path | None = None

    @property
    def pictures_per_epoch(self) -> int:
        """Number of training pictures in an epoch."""
        return len(self.split.training)

    @property
    def counted(self) -> int:
        """Number of training pictures whose points `count_points` counts."""
        return min(_COUNTED, self.pictures_per_epoch)

    def batches(self, recipe: Recipe, training_round: int) -> Iterator[Batch]:
        """All batches of a round, counted from 1."""
        seed = (recipe.seed, training_round)
        validation = len(self.split.validation)
        return schedule(seed, recipe.epochs, recipe.batch, self.pictures_per_epoch, validation, recipe.looks)

    def scheduled_graphs(self, configuration: TrainConfiguration) -> PictureGraphs:
        """The graphs of the items in `batches`. Raises InputError if a picture is missing."""
        return self.graphs((*self.split.training, *self.split.validation), configuration)

    def graphs(self, numbers: Sequence[str], configuration: TrainConfiguration) -> PictureGraphs:
        """The graphs of some pictures of the folder. Raises InputError if a picture is missing."""
        found = {each.number: each for each in find_pictures(self.folder)}
        missing = [number for number in numbers if number not in found]
        if missing:
            raise InputError(
                f"{len(missing)} pictures of the training are missing in {self.folder}, for example {missing[0]}"
            )
        recipe = _graph_recipe(configuration)
        pictures = [found[number] for number in numbers]
        if self.unpacked is None:
            return PictureGraphs(pictures, recipe)
        count = configuration.training.views
        views = GraphCache(self.unpacked, count, recipe) if count else None
        return PictureGraphs(pictures, recipe, DecodedCache(self.unpacked), views)

    def count_points(self, configuration: TrainConfiguration) -> npt.NDArray[np.int64]:
        """Number (C,) of each class's points in `counted` training pictures, without augmentation.

        These pictures are spread over the folder. Raises InputError.
        """
        graphs = self.scheduled_graphs(configuration)
        counts = np.zeros(len(configuration.classes.colors), dtype=np.int64)
        for position in np.linspace(0, self.pictures_per_epoch - 1, self.counted):
            labels = graphs[Item(int(position))].labels
            counts += np.bincount(labels[labels >= 0], minlength=len(counts))
        return counts


def _graph_recipe(configuration: TrainConfiguration) -> GraphRecipe:
    return GraphRecipe(
        configuration.classes.mask_classes(),
        configuration.manifest,
        configuration.grid,
        configuration.augmentation,
        own_radius=configuration.mesh.radius_of == "scene",
        window=configuration.training.window,
        mirrored=configuration.training.mirrored,
    )
