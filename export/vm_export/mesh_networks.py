"""The two kinds of mesh networks: on a graph of points, and on a canvas of strips."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch

from .canvas_network import CanvasNetwork
from .canvas_shape import CanvasShape
from .network import Network
from .network_shape import NetworkShape

MeshNetwork = Network | CanvasNetwork

MeshShape = NetworkShape | CanvasShape


def new_network(shape: MeshShape) -> MeshNetwork:
    """A network of this shape with random weights."""
    return CanvasNetwork(shape) if isinstance(shape, CanvasShape) else Network(shape)


def model_outputs(network: MeshNetwork, points: torch.Tensor, around: torch.Tensor) -> torch.Tensor:
    """What a model file of this network gives (n + 1, outputs): probabilities, and after them the outputs for peaks.

    points (n + 1, 3). around: neighbors (n + 1, N), or cells (n, 2) on strips.
    """
    if isinstance(network, CanvasNetwork):
        return network.answers(network.logits(points, around))
    return network.probabilities(points, around)


def read_shape(data: Mapping[str, Any]) -> MeshShape:
    """The shape of a network from the plain values of a checkpoint. Raises InputError."""
    return NetworkShape.from_dict(data) if "layers" in data else CanvasShape.from_dict(data)
