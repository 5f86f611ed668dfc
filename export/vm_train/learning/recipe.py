"""How a network is trained: section [training] of train.toml."""

from __future__ import annotations

from dataclasses import dataclass

from vm_embedded.config.entries import check_entries, number, one_of

from .selection import RULES

OPTIMIZERS = ("adamw", "adam", "sgd", "muon")
SCHEDULES = ("one_cycle", "constant")
LOSSES = ("cross_entropy", "focal")
PRECISIONS = ("full", "mixed")


@dataclass(frozen=True)
class Recipe:
    """Section [training]. Raises InputError."""

    epochs: int = number(20, "epochs of each round; the network is validated after each epoch", "", (1, 1e6))
    repeats: int = number(1, "number of times that an epoch uses each picture", "", (1, 1e6))
    batch: int = number(8, "pictures in a step, over all processes", "", (1, 1e5))
    window: float = number(
        1.0,
        "train on random windows with this share of the picture's width and height; in pictures with objects, most "
        "windows contain an object; 1: train on whole pictures",
        "",
        (0.05, 1.0),
    )
    mirrored: float = number(0.0, "share of the training examples that are mirror images", "", (0.0, 1.0))
    views: int = number(
        0,
        "number of augmented versions of each picture to cache on disk (camera pose, lens and sharpness differ); makes "
        "epochs faster; 0: no cache",
        "",
        (0, 1e4),
    )
    rate: float = number(0.01, "highest learning rate; vm-train rate proposes one", "", (1e-9, 1e3))
    optimizer: str = one_of(
        OPTIMIZERS,
        "adamw",
        "optimizer; sgd has momentum; muon suits short trainings, with a rate of 0.006 to 0.02",
    )
    schedule: str = one_of(
        SCHEDULES,
        "one_cycle",
        "learning rate over time; one_cycle: it rises once, then falls; constant: it stays the same",
    )
    decay: float = number(1e-4, "weight decay", "", (0.0, 1.0))
    clip: float = number(1.0, "largest norm of a step's gradient; 0: no limit", "", (0.0, 1e9))
    loss: str = one_of(LOSSES, "cross_entropy", "loss of a point; focal: confident points have less weight")
    gamma: float = number(2.0, "exponent of the focal loss", "", (0.0, 20.0))
    selection: str = one_of(
        RULES,
        "weighted",
        "points that give gradients; all: every labeled point; weighted: every labeled point, with less weight for "
        "frequent classes; balanced: the same number of each class, namely that of the rarest class of kind object; "
        "hard: balanced, preferring points with large errors in earlier rounds",
    )
    balance: float = number(
        0.3,
        "class weights for selection weighted; 0: all points have equal weight; 1: all classes have equal total weight",
        "",
        (0.0, 1.0),
    )
    # "This resampling was run twice" (paper: section "Training"): three rounds.
    rounds: int = number(3, "for selection hard: networks to train one after the other", "", (2, 10))
    patience: int = number(
        0, "a round ends after this many epochs without a better validation AP; 0: it never ends early", "", (0, 1e6)
    )
    precision: str = one_of(PRECISIONS, "full", "arithmetic; mixed: bfloat16 where that is safe; faster on a GPU")
    seed: int = number(0, "seed of weights, order, point selection and augmentation", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)

    @property
    def trainings(self) -> int:
        """Number of networks that are trained one after the other."""
        return self.rounds if self.selection == "hard" else 1

    def selection_of(self, training_round: int) -> str:
        """Rule of a round, counted from 1. The first round of "hard" is "balanced": it has no earlier network."""
        return "balanced" if self.selection == "hard" and training_round == 1 else self.selection
