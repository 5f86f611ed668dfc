"""look.toml: data, classes, patches, network, training and augmentation, a section each."""

from __future__ import annotations

import dataclasses
from dataclasses import Field, dataclass
from typing import TYPE_CHECKING, Any

from vm_embedded.config.entries import check_entries, entry, number, one_of, share
from vm_embedded.errors import InputError
from vm_workstation.ranges import range_of

from ..data.class_table import ClassTable
from ..runs.configuration import OPTIMIZERS

if TYPE_CHECKING:
    from vm_export.look_network import LookShape

_CHANNELS = 3
"""Convolutions that halve the patch; each has its number of channels."""


@dataclass(frozen=True)
class LookData:
    """Section [data]: the split of the pictures."""

    validation: float = share(
        0.1, "share of pictures for validation; they also set the scale of the probability (calibration)"
    )
    split_seed: int = number(0, "seed of the split", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class PatchSettings:
    """Section [patches]: which patches the network learns from, and how it gets them on the robot."""

    upright_radius: float = number(
        0.4,
        "for goal and robot, the radius of a circle around the base on the plane, which takes the place of the "
        "object's radius",
        "m",
        (0.01, 10.0),
    )
    size: int = number(32, "samples along each side of a patch", "px", (8, 128))
    extent: float = number(
        1.75,
        "half the side of a patch; for a tall cylinder in halves of its height",
        "apparent radii of the object",
        (0.5, 8.0),
    )
    max_proposals: int = number(
        10, "largest number of peaks of each class that it judges in a picture, here and on the robot", "", (1, 128)
    )
    jittered: int = number(
        6, "patches beside true objects of each class in a training picture that has some", "", (0, 1000)
    )
    jitter: float = number(0.9, "largest distance of these from the true center", "apparent radii", (0.0, 1.0))
    size_jitter: float = number(
        0.2,
        "natural logarithm of the largest factor by which these are cut too large or too small; the network learns "
        "the true size",
        "",
        (0.0, 0.5),
    )
    random: int = number(4, "patches of each class at random places on the plane in a training picture", "", (0, 1000))
    seed: int = number(0, "seed of the jittered and random places", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)


def _checked_channels(entry: Field[Any], value: Any) -> tuple[int, ...]:
    low, high = entry.metadata["limits"]
    whole = isinstance(value, list | tuple) and len(value) == _CHANNELS and all(type(each) is int for each in value)
    if not whole or not all(low <= each <= high for each in value):
        raise InputError(
            f"{entry.name} must be three whole numbers from {low} to {high}, as [16, 32, 48], not {value!r}"
        )
    return tuple(value)


def _channels(first: int, second: int, third: int, help: str) -> Any:
    return entry(_checked_channels, (first, second, third), help, limits=(1, 1024))


@dataclass(frozen=True)
class LookNetworkSettings:
    """Section [network]: the layers of the network."""

    channels: tuple[int, int, int] = _channels(
        16, 32, 48, "channels of the convolutions at a half, a quarter and an eighth of the patch's resolution"
    )
    hidden: int = number(
        0, "units of the layer before the answers; 0: as many as the last convolution has channels", "", (0, 1024)
    )

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class LookRecipe:
    """Section [training]. Raises InputError."""

    epochs: int = number(12, "epochs; the network is validated after each epoch", "", (1, 1e6))
    rounds: int = number(
        3,
        "rounds of the training; before each round except the first, the current network scores all patches without "
        "an object, and those with larger errors are then drawn more often; at most one round for each epoch; "
        "1: all with the same chance",
        "",
        (1, 100),
    )
    floor: float = number(
        0.05,
        "with rounds > 1, added to the error of each patch without an object; higher: patches with small errors are "
        "drawn more often",
        "",
        (1e-3, 100.0),
    )
    batch: int = number(256, "patches in a step", "", (2, 1e5))
    positives: float = number(0.33, "share of each batch that shows an object", "", (0.01, 0.99))
    optimizer: str = one_of(
        OPTIMIZERS, "muon", "optimizer; adamw needs a lower rate, such as 0.003, and more epochs; sgd has momentum"
    )
    rate: float = number(0.02, "highest learning rate; it rises once, then falls (one cycle)", "", (1e-9, 1e3))
    decay: float = number(0.02, "weight decay", "", (0.0, 1.0))
    seed: int = number(0, "seed of weights, batches and augmentation", "", (0, 2**31))

    def __post_init__(self) -> None:
        check_entries(self)

    def begins_round(self, epoch: int) -> bool:
        """Whether an epoch, counted from 0, begins a round after the first one."""
        before, now = ((epoch - 1 + each) * min(self.rounds, self.epochs) // self.epochs for each in (0, 1))
        return epoch > 0 and before < now


@dataclass(frozen=True)
class PatchAugmentation:
    """Section [augmentation]: how strongly patches are changed. 0 switches an entry off. Raises InputError."""

    mirror: float = share(0.5, "share of the patches that are mirror images")
    rotation: float = number(12.0, "standard deviation of the rotation", "deg", (0.0, 180.0))
    zoom: float = number(0.12, "standard deviation of the logarithm of the zoom", "", (0.0, 0.5))
    shift: float = number(
        0.25, "largest shift to the right or left, and up or down", "apparent radii of the object", (0.0, 1.0)
    )
    hidden: float = share(0.2, "share of the patches of which a rectangle is hidden")
    gamma: float = number(0.15, "standard deviation of the logarithm of the gamma exponent", "", (0.0, 2.0))
    gain: float = number(0.12, "standard deviation of the logarithm of each color channel's gain", "", (0.0, 2.0))
    gray: float = share(0.03, "share of the patches without color")
    blur_share: float = share(0.1, "share of the patches that are blurred")
    blur: tuple[float, float] = range_of(0.4, 1.0, "range of the blur's standard deviation", "samples", (0.1, 3.0))
    noise_share: float = share(0.2, "share of the patches with noise")
    noise: float = number(0.02, "largest standard deviation of the noise, as a share of white", "", (0.0, 1.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class LookConfiguration:
    """All sections."""

    data: LookData = dataclasses.field(default_factory=LookData)
    classes: ClassTable = dataclasses.field(
        default_factory=ClassTable.default,
        metadata={"read": ClassTable.from_table, "to_commented_toml": ClassTable.to_commented_toml},
    )
    patches: PatchSettings = dataclasses.field(default_factory=PatchSettings)
    network: LookNetworkSettings = dataclasses.field(default_factory=LookNetworkSettings)
    training: LookRecipe = dataclasses.field(default_factory=LookRecipe)
    augmentation: PatchAugmentation = dataclasses.field(default_factory=PatchAugmentation)

    def shape(self, classes: int) -> LookShape:
        """The layers of a network for this number of classes. Raises InputError."""
        from vm_export.look_network import LookShape  # torch takes a second to load

        return LookShape(self.patches.size, self.network.channels, self.network.hidden, classes)
