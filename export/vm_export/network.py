"""The network in torch: graph convolutions on the Visual Mesh."""

from __future__ import annotations

import torch
from torch import nn

from .neighborhood import Neighborhood
from .network_shape import Layer, NetworkShape

# The paper compares SELU, ELU and ReLU (section "Network Architecture").
_ACTIVATIONS: dict[str, type[nn.Module]] = {"selu": nn.SELU, "relu": nn.ReLU, "elu": nn.ELU, "tanh": nn.Tanh}


class GraphConvolution(nn.Module):
    """The paper's graph convolution (section "Network"): a linear layer on a point and its N neighbors.

    It gathers (N + 1) * inputs values, the point's own channels first, then those of each neighbor in turn. With six
    neighbors this is the counterpart of a 3 x 3 convolution.
    """

    def __init__(self, inputs: int, outputs: int, neighbors: int) -> None:
        super().__init__()
        self.neighbors = neighbors
        self.linear = nn.Linear((neighbors + 1) * inputs, outputs)

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs)."""
        return self.linear(neighborhood.gather(x).flatten(1))  # type: ignore[no-any-return]


class SeparableConvolution(nn.Module):
    """A graph convolution in two steps: a weight for each neighbor and channel, then a linear mix of the channels."""

    def __init__(self, inputs: int, outputs: int, neighbors: int) -> None:
        super().__init__()
        self.depthwise = nn.Parameter(torch.randn(neighbors + 1, inputs) / (neighbors + 1) ** 0.5)
        self.linear = nn.Linear(inputs, outputs)

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs)."""
        mixed = (neighborhood.gather(x) * self.depthwise).sum(dim=1)
        return self.linear(mixed)  # type: ignore[no-any-return]


class Dense(nn.Module):
    """A linear layer on each point by itself."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs)

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs); the neighbors are not used."""
        return self.linear(x)  # type: ignore[no-any-return]


GraphLayer = GraphConvolution | SeparableConvolution | Dense


class Network(nn.Module):
    """A Visual Mesh network: from points and neighbors to probabilities, or to logits in training.

    Row n of the points is the off-screen point: -1 in every channel and linked to itself. It goes through every layer.
    """

    def __init__(self, shape: NetworkShape) -> None:
        super().__init__()
        self.shape = shape
        widths = [3, *(layer.width for layer in shape.layers)]
        self.layers = nn.ModuleList(
            _make(layer, inputs, shape.neighbors) for layer, inputs in zip(shape.layers, widths, strict=False)
        )
        self.activations = nn.ModuleList(_ACTIVATIONS[layer.activation]() for layer in shape.layers[:-1])
        for module in self.modules():
            if isinstance(module, nn.Linear):  # LeCun's initialization, with which SELU keeps the variance
                nn.init.normal_(module.weight, std=module.in_features**-0.5)
                nn.init.zeros_(module.bias)

    @property
    def typed_layers(self) -> list[GraphLayer]:
        """The layers with their types."""
        return [layer for layer in self.layers if isinstance(layer, GraphLayer)]

    def logits(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Outputs (n + 1, C) before the head, from points (n + 1, 3) and neighbors (n + 1, N)."""
        x, neighborhood = points, Neighborhood(neighbors)
        for layer, activation in zip(self.layers, self.activations, strict=False):
            x = activation(layer(x, neighborhood))
        return self.layers[-1](x, neighborhood)  # type: ignore[no-any-return]

    def probabilities(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Probabilities (n + 1, C) from points (n + 1, 3) and neighbors (n + 1, N)."""
        logits = self.logits(points, neighbors)
        return logits.softmax(dim=1) if self.shape.layers[-1].activation == "softmax" else logits.sigmoid()

    forward = probabilities


def _make(layer: Layer, inputs: int, neighbors: int) -> GraphLayer:
    if layer.kind == "dense":
        return Dense(inputs, layer.width)
    kind = GraphConvolution if layer.kind == "convolution" else SeparableConvolution
    return kind(inputs, layer.width, neighbors)
