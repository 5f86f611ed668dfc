"""Measures the batch normalizations of a network that comes without their statistics.

An exported network has no batch normalization: its convolutions include it. A training needs it again, with the mean
and the variance of each channel. Other values than the true ones would change the network in its first steps.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import torch
from torch import nn


@torch.no_grad()
def measure(network: nn.Module, batches: Iterable[torch.Tensor]) -> None:
    """Give each normalization the mean and the variance of its input over all batches (n, 3, h, w).

    Scale and bias change with them, so the network gives the same answers as before in evaluation mode. Therefore one
    pass measures all normalizations.
    """
    layers = [each for each in network.modules() if isinstance(each, nn.BatchNorm2d)]
    sums = {each: torch.zeros(3, each.num_features, dtype=torch.float64) for each in layers}

    def add(layer: nn.Module, inputs: tuple[Any, ...]) -> None:
        x = inputs[0].double()
        assert isinstance(layer, nn.BatchNorm2d)
        count = torch.full((x.shape[1],), float(x[:, 0].numel()))
        sums[layer] += torch.stack([count, x.sum(dim=(0, 2, 3)), x.square().sum(dim=(0, 2, 3))])

    hooks = [each.register_forward_pre_hook(add) for each in layers]
    was_training = network.training
    network.eval()
    for batch in batches:
        network(batch)
    network.train(was_training)
    for hook in hooks:
        hook.remove()
    for layer in layers:
        count, total, squares = sums[layer]
        mean = total / count
        _set(layer, mean, (squares / count - mean.square()).clamp(min=0.0))


def _set(layer: nn.BatchNorm2d, mean: torch.Tensor, variance: torch.Tensor) -> None:
    """Set statistics (channels,), and with them scale and bias for the same answers."""
    assert layer.running_mean is not None
    assert layer.running_var is not None
    factor = layer.weight / (layer.running_var + layer.eps).sqrt()
    layer.bias += (mean - layer.running_mean) * factor
    layer.weight.copy_(factor * (variance + layer.eps).sqrt())
    layer.running_mean.copy_(mean)
    layer.running_var.copy_(variance)
