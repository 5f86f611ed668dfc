"""Counts of multiplications and additions, as they are published for networks: two for each weight that is applied."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import nn


def operations(make: Callable[[], nn.Module], *shapes: tuple[int, ...]) -> int:
    """Multiplications and additions of the convolutions and linear layers for inputs of these shapes.

    The network is made and run without memory for its values.
    """
    total = 0

    def count(layer: nn.Module, _inputs: object, outputs: torch.Tensor) -> None:
        nonlocal total
        weight = layer.weight
        assert isinstance(weight, torch.Tensor)
        total += 2 * outputs.numel() * weight[0].numel()

    with torch.device("meta"), torch.no_grad():
        network = make().eval()
        for layer in network.modules():
            if isinstance(layer, nn.Conv2d | nn.Linear):
                layer.register_forward_hook(count)
        network(*(torch.empty(shape) for shape in shapes))
    return total
