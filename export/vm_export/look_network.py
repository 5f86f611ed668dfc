"""The look network in torch: a small convolutional network that judges one patch of the picture at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import nn

from vm_embedded.errors import InputError
from vm_embedded.network.look_example import ANSWERS

_WIDEST = 1024
"""Limit of every width."""

NOISE_FLOOR = 4.0
"""Added to the deviation of a patch's colors, from 0 to 255, so that noise on a plain surface is not amplified."""


@dataclass(frozen=True)
class LookShape:
    """The layers of a look network.

    size: samples along each side of a patch, 8 to 128.
    channels: of the convolutions at a half, a quarter and an eighth of the patch's resolution. At a quarter, there is
        one more, a separable one.
    hidden: units of the layer before the answers; 0 means as many as the last convolution has channels.

    Raises InputError for values out of range.
    """

    size: int = 32
    channels: tuple[int, int, int] = (16, 32, 48)
    hidden: int = 0

    def __post_init__(self) -> None:
        if not 8 <= self.size <= 128:
            raise InputError(f"size of a look network must be from 8 to 128, not {self.size}")
        if len(self.channels) != 3 or not all(1 <= each <= _WIDEST for each in self.channels):
            raise InputError(
                f"channels of a look network must be three numbers from 1 to {_WIDEST}, not {list(self.channels)}"
            )
        if not 0 <= self.hidden <= _WIDEST:
            raise InputError(f"hidden units of a look network must be from 0 to {_WIDEST}, not {self.hidden}")

    @property
    def hidden_units(self) -> int:
        """Units of the hidden layer, also if `hidden` is 0."""
        return self.hidden or self.channels[-1]

    @property
    def flat(self) -> int:
        """Values of a patch after the convolutions: channels times rows times columns."""
        side = -(-self.size // 8)  # each of three convolutions halves the side, rounding up
        return self.channels[-1] * side * side

    def as_dict(self) -> dict[str, Any]:
        """The shape as plain values for a checkpoint."""
        return asdict(self) | {"channels": list(self.channels)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> LookShape:
        """Inverse of `as_dict`. Raises InputError."""
        try:
            first, second, third = map(int, data["channels"])
            return cls(int(data["size"]), (first, second, third), int(data["hidden"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"can't read the shape of a look network: {error}") from error


class LookNetwork(nn.Module):
    """A look network: from patches to answers, or to logits and shifts in training.

    Patches are (n, size, size, 3), RGB: uint8, or floats from 0 to 255 where augmentation makes them. The network
    normalizes them itself. The buffer `calibration` (2,) holds the scale and the offset that turn a logit into the
    logit of a calibrated probability.
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
            ]
        )
        self.hidden = nn.Linear(shape.flat, shape.hidden_units)
        self.answers = nn.Linear(shape.hidden_units, len(ANSWERS))
        self.register_buffer("calibration", torch.tensor([1.0, 0.0]))

    @property
    def typed_convolutions(self) -> list[nn.Conv2d]:
        """The Conv2d layers, typed for mypy."""
        return [layer for layer in self.convolutions if isinstance(layer, nn.Conv2d)]

    def logits(self, patches: torch.Tensor) -> torch.Tensor:
        """Outputs (n, 4) for patches (n, size, size, 3): logit, right, down and log size, before calibration."""
        x = normalized(patches.float()).permute(0, 3, 1, 2)
        for layer in self.convolutions:
            x = torch.relu(layer(x))
        return self.answers(torch.relu(self.hidden(x.flatten(1))))  # type: ignore[no-any-return]

    def forward(self, patches: torch.Tensor) -> torch.Tensor:
        """Answers (n, 4) for patches (n, size, size, 3), as CloseLook.run describes them."""
        logits = self.logits(patches)
        scale, offset = self.calibration
        return torch.cat([torch.sigmoid(scale * logits[:, :1] + offset), logits[:, 1:]], dim=1)


def normalized(patches: torch.Tensor) -> torch.Tensor:
    """Patches (n, size, size, 3) less their mean color value, over its deviation, so that brightness hardly matters.

    All three channels share one mean and one deviation, so the hue of a patch stays visible.
    """
    x = patches - patches.mean((1, 2, 3), keepdim=True)
    return x / (x.square().mean((1, 2, 3), keepdim=True).sqrt() + NOISE_FLOOR)
