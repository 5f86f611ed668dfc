"""tune.toml: data, patches, training and augmentation of a fine-tuning, a section each."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from vm_embedded.config.entries import check_entries, number, share

from ..look.configuration import LookRecipe, PatchAugmentation


@dataclass(frozen=True)
class TuningData:
    """Section [data]: the split of the pictures."""

    validation: float = share(
        0.15, "share of the pictures for validation; a recording is either all for training or all for validation"
    )
    test: float = share(
        0.15,
        "share of the pictures for the test, which measures the result; whole recordings, or the last third of each "
        "recording if all are too large",
    )
    split_seed: int = number(0, "seed of the split", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class WindowSettings:
    """Section [patches]: which patches of a picture the network learns from."""

    jittered: int = number(6, "patches beside each box", "", (1, 1000))
    jitter: float = number(0.6, "largest distance of these from the center of the box", "radii", (0.0, 0.6))
    size_jitter: float = number(
        0.25, "natural logarithm of the largest factor by which these are cut too large or too small", "", (0.0, 0.28)
    )
    random: int = number(12, "patches at random places", "", (0, 1000))
    candidates: int = number(
        30, "largest number of patches at the network's own candidates, found at all places and sizes", "", (1, 1000)
    )
    above: float = number(0.005, "lowest probability of such a candidate in the first pass", "", (0.0, 0.99))
    seed: int = number(0, "seed of the places", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class TuningRecipe:
    """Section [training]. Raises InputError."""

    epochs: int = number(8, "largest number of epochs; the network is validated after each epoch", "", (1, 1e4))
    steps: int = number(60, "steps of an epoch", "", (1, 1e6))
    patience: int = number(5, "epochs without a better validation after which the training ends", "", (1, 1e4))
    own: float = number(0.5, "share of each batch that shows your own frames; the others are rendered", "", (0.01, 1.0))
    distillation: float = number(
        1.0,
        "share of a rendered patch's target that is the answer of the network before; higher: it forgets less",
        "",
        (0.0, 1.0),
    )
    forgetting: float = number(
        0.2,
        "the largest increase of the loss on rendered patches, as a share of that of the network before; the weights "
        "are mixed with those before until it is kept; higher: it learns more and forgets more",
        "",
        (0.0, 100.0),
    )
    batch: int = number(256, "patches in a step", "", (2, 1e5))
    positives: float = number(0.33, "share of each batch that shows an object", "", (0.01, 0.99))
    rate: float = number(1e-3, "highest learning rate; it rises once, then falls (one cycle)", "", (1e-9, 1e3))
    decay: float = number(0.02, "weight decay", "", (0.0, 1.0))
    seed: int = number(0, "seed of batches and augmentation", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)

    def as_look_recipe(self) -> LookRecipe:
        """The recipe of a trainer."""
        return LookRecipe(
            epochs=self.epochs,
            rounds=1,
            batch=self.batch,
            positives=self.positives,
            optimizer="adamw",
            rate=self.rate,
            decay=self.decay,
            seed=self.seed,
        )


@dataclass(frozen=True)
class TuningConfiguration:
    """All sections."""

    data: TuningData = dataclasses.field(default_factory=TuningData)
    patches: WindowSettings = dataclasses.field(default_factory=WindowSettings)
    training: TuningRecipe = dataclasses.field(default_factory=TuningRecipe)
    augmentation: PatchAugmentation = dataclasses.field(default_factory=PatchAugmentation)
