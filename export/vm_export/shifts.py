"""A network with and without shifts to the centers of objects; its other answers are the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch

from vm_embedded.arrays import Floats

from .checkpoint import Checkpoint
from .network import Network


def with_shifts(checkpoint: Checkpoint, class_name: str, weights: Floats) -> Checkpoint:
    """A network with shifts to the objects of a class, instead of those that it has.

    weights (F + 1, 2): of the F values that the last layer takes of a point; the last row is added. Raises ModelError
    for a class that is not of kind object.
    """
    bare = without_shifts(checkpoint)
    *kernel, bias = torch.from_numpy(weights).float()
    more = {"weight": torch.stack(kernel, dim=1), "bias": bias}
    return _with_outputs(bare, class_name, lambda name, own: torch.cat([own, more[name]]))


def without_shifts(checkpoint: Checkpoint) -> Checkpoint:
    """A network without the shifts that it may have."""
    classes = checkpoint.network.shape.classes
    return _with_outputs(checkpoint, None, lambda _, own: own[:classes])


def _with_outputs(
    checkpoint: Checkpoint, shifts: str | None, change: Callable[[str, torch.Tensor], torch.Tensor]
) -> Checkpoint:
    """The network with another last layer. change: its parameters "weight" and "bias" from its name and old values."""
    network = Network(replace(checkpoint.network.shape, shifts=shifts is not None))
    state = checkpoint.network.state_dict()
    for name in ("weight", "bias"):
        key = f"layers.{len(network.layers) - 1}.linear.{name}"
        state[key] = change(name, state[key])
    network.load_state_dict(state)
    return replace(checkpoint, network=network.eval(), manifest=replace(checkpoint.manifest, shifts=shifts))
