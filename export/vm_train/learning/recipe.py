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

    epochs: int = number(20, "epochs of each round; after each the network is validated", "", (1, 1e6))
    looks: int = number(1, "how often an epoch looks at each picture", "", (1, 1e6))
    batch: int = number(8, "pictures in a step, over all processes", "", (1, 1e5))
    window: float = number(
        1.0,
        "looks are at windows of pictures, of this share of width and height; most of them show an object if the "
        "picture does",
        "",
        (0.05, 1.0),
    )
    mirrored: float = number(0.0, "share of the looks that are at the picture's mirror image", "", (0.0, 1.0))
    views: int = number(
        0,
        "draws of pose, lens and sharpness that are kept for each picture, which is faster; 0: each look has its own",
        "",
        (0, 1e4),
    )
    rate: float = number(0.01, "highest learning rate; vm-train rate looks for it", "", (1e-9, 1e3))
    optimizer: str = one_of(
        OPTIMIZERS,
        "adamw",
        "how weights follow their gradients; sgd has momentum; muon is for short trainings, at a rate of 0.007 to 0.02",
    )
    schedule: str = one_of(SCHEDULES, "one_cycle", "how the rate changes: up and down once, or not at all")
    decay: float = number(1e-4, "weight decay", "", (0.0, 1.0))
    clip: float = number(1.0, "largest norm of a step's gradient; 0 for any", "", (0.0, 1e9))
    loss: str = one_of(LOSSES, "cross_entropy", "focal weighs points that the network is sure of less")
    gamma: float = number(2.0, "exponent of the focal loss", "", (0.0, 20.0))
    selection: str = one_of(
        RULES,
        "balanced",
        "points that give gradients: all; weighed, all, those of frequent classes counting less; balanced, as many of "
        "each class as of the rarest object; or hard, those that earlier networks were wrong about, balanced",
    )
    balance: float = number(
        1.0, "if selection is weighed: from 0, every point counts the same, to 1, every class does", "", (0.0, 1.0)
    )
    smoothing: float = number(
        0.0, "share of a point's label that its neighbors' labels have, so that outlines are soft", "", (0.0, 1.0)
    )
    distillation: float = number(
        0.5,
        "share of the answers of vm-train --teacher in what is to be learned, the rest being labels",
        "",
        (0.0, 1.0),
    )
    averaging: float = number(
        0.0,
        "part of the averaged weights that a step keeps, 0.999 for a mean of about the last thousand; they are what is "
        "validated and kept; 0: those of the last step are",
        "",
        (0.0, 0.999999),
    )
    rounds: int = number(3, "networks trained one after the other, if selection is hard", "", (2, 10))
    patience: int = number(0, "epochs without a better validation after which a round ends; 0 for none", "", (0, 1e6))
    precision: str = one_of(PRECISIONS, "full", "mixed computes in bfloat16 where that is safe: faster on a GPU")
    seed: int = number(0, "of weights, order, selection and augmentation", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)

    @property
    def trainings(self) -> int:
        """Networks that are trained one after the other."""
        return self.rounds if self.selection == "hard" else 1

    def selection_of(self, training_round: int) -> str:
        """Rule of a round, counted from 1: of the first no earlier network knows what is hard."""
        return "balanced" if self.selection == "hard" and training_round == 1 else self.selection
