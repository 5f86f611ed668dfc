"""The look network in torch: a small convolutional network that judges one patch of the picture at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import nn

from vm_embedded.errors import InputError
from vm_embedded.network.look_example import ANSWERS
from vm_embedded.network.manifest import MOST_CLASSES

_WIDEST = 1024
"""Limit of every width."""

FIRST_OF_SUM, LAST_OF_SUM = 2, 3
"""Numbers of the two convolutions of the separable one, whose result is added to its input."""

NOISE_FLOOR = 4.0
"""Added to the deviation of a patch's colors, from 0 to 255, so that noise on a plain surface is not amplified."""


@dataclass(frozen=True)
class LookShape:
    """The layers of a look network.

    size: samples along each side of a patch, 8 to 128.
    channels: of the convolutions at a half, a quarter and an eighth of the patch's resolution. At a quarter, there is
        one more, a separable one, whose result is added to its input. At an eighth, half of the channels, their
        mixtures, go on.
    hidden: units of the layer before the answers; 0 means as many as the last convolution has channels.
    classes: that it judges, 1 to 127.

    Raises InputError for values out of range.
    """

    size: int = 32
    channels: tuple[int, int, int] = (16, 32, 48)
    hidden: int = 0
    classes: int = 1

    def __post_init__(self) -> None:
        if not 8 <= self.size <= 128:
            raise InputError(f"size of a look network must be from 8 to 128, not {self.size}")
        if len(self.channels) != 3 or not all(1 <= each <= _WIDEST for each in self.channels):
            raise InputError(
                f"channels of a look network must be three numbers from 1 to {_WIDEST}, not {list(self.channels)}"
            )
        if not 0 <= self.hidden <= _WIDEST:
            raise InputError(f"hidden units of a look network must be from 0 to {_WIDEST}, not {self.hidden}")
        if not 1 <= self.classes <= MOST_CLASSES:
            raise InputError(f"classes of a look network must be from 1 to {MOST_CLASSES}, not {self.classes}")

    @property
    def hidden_units(self) -> int:
        """Units of the hidden layer, also if `hidden` is 0."""
        return self.hidden or self.channels[-1]

    @property
    def fewer(self) -> int:
        """Channels that go on after the convolutions. The hidden layer's weights, which do not fit in the cache, take
        the time of a run with few patches."""
        return -(-self.channels[-1] // 2)

    @property
    def flat(self) -> int:
        """Values of a patch after the convolutions: channels times rows times columns."""
        side = -(-self.size // 8)  # each of three convolutions halves the side, rounding up
        return self.fewer * side * side

    def as_dict(self) -> dict[str, Any]:
        """The shape as plain values for a checkpoint."""
        return asdict(self) | {"channels": list(self.channels)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> LookShape:
        """Inverse of `as_dict`. Raises InputError."""
        try:
            first, second, third = map(int, data["channels"])
            return cls(int(data["size"]), (first, second, third), int(data["hidden"]), int(data["classes"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"can't read the shape of a look network: {error}") from error


class LookNetwork(nn.Module):
    """A look network: from patches to answers, or to logits and shifts in training.

    Patches are (n, size, size, 3), RGB: uint8, or floats from 0 to 255 where augmentation makes them. The network
    normalizes them itself. The buffer `calibration` (C, 2) holds for each class the scale and the offset that turn a
    logit into the logit of a calibrated probability.
    """

    calibration: torch.Tensor

    def __init__(self, shape: LookShape) -> None:
        super().__init__()
        self.shape = shape
        half, quarter, eighth = shape.channels
        self.convolutions = nn.ModuleList(
            [
                nn.Conv2d(3, half, 3, stride=2, padding=1),
                nn.Conv2d(half, quarter, 3, stride=2, padding=1),
                nn.Conv2d(quarter, quarter, 3, padding=1, groups=quarter),
                nn.Conv2d(quarter, quarter, 1),
                nn.Conv2d(quarter, eighth, 3, stride=2, padding=1),
                nn.Conv2d(eighth, shape.fewer, 1),
            ]
        )
        self.hidden = nn.Linear(shape.flat, shape.hidden_units)
        self.answers = nn.Linear(shape.hidden_units, shape.classes * len(ANSWERS))
        self.register_buffer("calibration", torch.tensor([[1.0, 0.0]] * shape.classes))

    @property
    def typed_convolutions(self) -> list[nn.Conv2d]:
        """The Conv2d layers, typed for mypy."""
        return [layer for layer in self.convolutions if isinstance(layer, nn.Conv2d)]

    def logits(self, patches: torch.Tensor) -> torch.Tensor:
        """Outputs (n, C, 4) for patches (n, size, size, 3): logit, right, down and log size of each class, before
        calibration."""
        x = normalized(patches.float()).permute(0, 3, 1, 2)
        before = x
        for number, layer in enumerate(self.convolutions):
            if number == FIRST_OF_SUM:
                before = x
            x = torch.relu(layer(x))
            if number == LAST_OF_SUM:
                x = x + before
        answers: torch.Tensor = self.answers(torch.relu(self.hidden(x.flatten(1))))
        return answers.reshape(-1, self.shape.classes, len(ANSWERS))

    def forward(self, patches: torch.Tensor) -> torch.Tensor:
        """Answers (n, C, 4) for patches (n, size, size, 3), as CloseLook.run describes them."""
        logits = self.logits(patches)
        scale, offset = self.calibration.T
        presence = torch.sigmoid(scale * logits[..., 0] + offset)
        return torch.cat([presence[..., None], logits[..., 1:]], dim=2)


def normalized(patches: torch.Tensor) -> torch.Tensor:
    """Patches (n, size, size, 3) less their mean color value, over its deviation, so that brightness hardly matters.

    All three channels share one mean and one deviation, so the hue of a patch stays visible.
    """
    x = patches - patches.mean((1, 2, 3), keepdim=True)
    return x / (x.square().mean((1, 2, 3), keepdim=True).sqrt() + NOISE_FLOOR)
