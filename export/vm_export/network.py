"""The network in torch: graph convolutions on the Visual Mesh."""

from __future__ import annotations

import torch
from torch import nn

from .neighborhood import Neighborhood
from .network_shape import NetworkShape

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

    def field(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """What the linear layer takes: (n + 1, (N + 1) * inputs) from x (n + 1, inputs)."""
        return neighborhood.gather(x).flatten(1)

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs)."""
        return self.linear(self.field(x, neighborhood))  # type: ignore[no-any-return]


class SeparableConvolution(nn.Module):
    """A graph convolution in two steps: a weight for each neighbor and channel, then a linear mix of the channels."""

    def __init__(self, inputs: int, outputs: int, neighbors: int) -> None:
        super().__init__()
        self.depthwise = nn.Parameter(torch.randn(neighbors + 1, inputs) / (neighbors + 1) ** 0.5)
        self.linear = nn.Linear(inputs, outputs)

    def field(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """What the linear layer takes: the weighted sums (n + 1, inputs) from x (n + 1, inputs)."""
        return (neighborhood.gather(x) * self.depthwise).sum(dim=1)

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs)."""
        return self.linear(self.field(x, neighborhood))  # type: ignore[no-any-return]


class Dense(nn.Module):
    """A linear layer on each point by itself."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs)

    def field(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """What the linear layer takes: x (n + 1, inputs); the neighbors are not used."""
        return x

    def forward(self, x: torch.Tensor, neighborhood: Neighborhood) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs)."""
        return self.linear(self.field(x, neighborhood))  # type: ignore[no-any-return]


GraphLayer = GraphConvolution | SeparableConvolution | Dense


class Network(nn.Module):
    """A Visual Mesh network: from points and neighbors to probabilities, or to logits in training.

    Row n of the points is the off-screen point: -1 in every channel and linked to itself. It goes through every layer.
    """

    def __init__(self, shape: NetworkShape) -> None:
        super().__init__()
        self.shape = shape
        inputs = [3, *shape.outputs[:-1]]
        self.layers = nn.ModuleList(
            _make(layer.kind, taken, given, shape.neighbors)
            for layer, taken, given in zip(shape.layers, inputs, shape.outputs, strict=True)
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
        """Outputs before the head, and shifts: (n + 1, C) or (n + 1, C + 2), from the inputs of `forward`."""
        x, around = self._before_last(points, neighbors)
        return self.layers[-1](x, around)  # type: ignore[no-any-return]

    def fields(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """The receptive fields (n + 1, F) of the last layer's points, from the inputs of `forward`."""
        x, around = self._before_last(points, neighbors)
        return self.typed_layers[-1].field(x, around)

    def _before_last(self, points: torch.Tensor, neighbors: torch.Tensor) -> tuple[torch.Tensor, Neighborhood]:
        """The last layer's input (n + 1, channels) and neighborhood."""
        parts = torch.split(neighbors, self.shape.neighbors, dim=1)
        around = dict(zip(self.shape.dilations, map(Neighborhood, parts), strict=True))
        x = points
        for spec, layer, activation in zip(self.shape.layers, self.layers, self.activations, strict=False):
            x = activation(layer(x, around[spec.dilation]))
        return x, around[self.shape.layers[-1].dilation]

    def forward(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Probabilities, and shifts: (n + 1, C) or (n + 1, C + 2), from points (n + 1, 3) and neighbors (n + 1, D N),
        with_dilations."""
        answers = self.logits(points, neighbors)
        logits, shifts = answers[:, : self.shape.classes], answers[:, self.shape.classes :]
        is_softmax = self.shape.layers[-1].activation == "softmax"
        return torch.cat([logits.softmax(dim=1) if is_softmax else logits.sigmoid(), shifts], dim=1)


def _make(kind: str, inputs: int, outputs: int, neighbors: int) -> GraphLayer:
    if kind == "dense":
        return Dense(inputs, outputs)
    made = GraphConvolution if kind == "convolution" else SeparableConvolution
    return made(inputs, outputs, neighbors)
