"""The network in torch: graph convolutions on the Visual Mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import nn

from vm_embedded.errors import InputError, unknown

ACTIVATIONS: dict[str, type[nn.Module]] = {"selu": nn.SELU, "relu": nn.ReLU, "elu": nn.ELU, "tanh": nn.Tanh}
HEADS = ("softmax", "sigmoid")
KINDS = ("convolution", "separable", "dense")


@dataclass(frozen=True)
class Layer:
    """One layer: its kind (one of KINDS), its width, and its activation (of the last one: a head)."""

    kind: str
    width: int
    activation: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(unknown("kind of layer", self.kind, KINDS))
        if self.activation not in (*ACTIVATIONS, *HEADS):
            raise InputError(unknown("activation", self.activation, (*ACTIVATIONS, *HEADS)))
        if self.width < 1:
            raise InputError(f"a layer's width must be at least 1, not {self.width}")


@dataclass(frozen=True)
class NetworkShape:
    """Layers of a network for points with three colors and `neighbors` neighbors each.

    Raises InputError if the first layer is dense, or a head stands anywhere but at the end.
    """

    layers: tuple[Layer, ...]
    neighbors: int = 6

    def __post_init__(self) -> None:
        if not self.layers or self.layers[0].kind == "dense":
            raise InputError("a network begins with a convolution")
        heads = [layer.activation in HEADS for layer in self.layers]
        if not heads[-1] or any(heads[:-1]):
            raise InputError(f"a network ends with one of {', '.join(HEADS)}, and has it nowhere else")

    @classmethod
    def uniform(
        cls,
        depth: int,
        width: int,
        classes: int,
        activation: str = "selu",
        head: str = "softmax",
        kind: str = "convolution",
        neighbors: int = 6,
    ) -> NetworkShape:
        """`depth` convolutions, all but the last one of `width`: the paper's networks."""
        inner = (Layer(kind, width, activation),) * (depth - 1)
        return cls((*inner, Layer(kind, classes, head)), neighbors)

    @property
    def classes(self) -> int:
        """Number of outputs."""
        return self.layers[-1].width

    @property
    def operations(self) -> int:
        """Multiplications and additions for each point, activations not counted."""
        total, inputs = 0, 3
        for layer in self.layers:
            places = 1 if layer.kind == "dense" else self.neighbors + 1
            mixed = places * inputs * layer.width if layer.kind == "convolution" else inputs * layer.width
            total += 2 * (mixed + (places * inputs if layer.kind == "separable" else 0))
            inputs = layer.width
        return total

    def as_dict(self) -> dict[str, Any]:
        """Plain values for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> NetworkShape:
        """Inverse of `as_dict`. Raises InputError."""
        try:
            return cls(tuple(Layer(**layer) for layer in data["layers"]), int(data["neighbors"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"network description can't be read: {error}") from error


class GraphConvolution(nn.Module):
    """Gather [self, neighbors...] of all channels, neighbor-major, times a kernel ((N + 1) inputs, outputs), plus bias.

    The paper's section on the network: a 3 x 3 convolution on a graph of six neighbors.
    """

    def __init__(self, inputs: int, outputs: int, neighbors: int) -> None:
        super().__init__()
        self.neighbors = neighbors
        self.linear = nn.Linear((neighbors + 1) * inputs, outputs)

    def forward(self, x: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs) and neighbors (n + 1, N)."""
        gathered: torch.Tensor = torch.cat([x, x[neighbors].flatten(1)], dim=1)
        return self.linear(gathered)  # type: ignore[no-any-return]


class SeparableConvolution(nn.Module):
    """A graph convolution whose kernel is a weight for each neighbor and channel, then a mix of the channels."""

    def __init__(self, inputs: int, outputs: int, neighbors: int) -> None:
        super().__init__()
        self.depthwise = nn.Parameter(torch.randn(neighbors + 1, inputs) / (neighbors + 1) ** 0.5)
        self.linear = nn.Linear(inputs, outputs)

    def forward(self, x: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs) and neighbors (n + 1, N)."""
        mixed = (x[neighbors] * self.depthwise[1:]).sum(dim=1) + x * self.depthwise[0]
        return self.linear(mixed)  # type: ignore[no-any-return]


class Dense(nn.Module):
    """A layer on each point alone."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs)

    def forward(self, x: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """(n + 1, outputs) from x (n + 1, inputs); the neighbors are not used."""
        return self.linear(x)  # type: ignore[no-any-return]


GraphLayer = GraphConvolution | SeparableConvolution | Dense


class Network(nn.Module):
    """A Visual Mesh network: (points, neighbors) to probabilities, or to logits in training.

    Row n of the points is the off-screen point: -1 in every channel, linked to itself, it goes through every layer.
    """

    def __init__(self, shape: NetworkShape) -> None:
        super().__init__()
        self.shape = shape
        widths = [3, *(layer.width for layer in shape.layers)]
        self.layers = nn.ModuleList(
            _make(layer, inputs, shape.neighbors) for layer, inputs in zip(shape.layers, widths, strict=False)
        )
        self.activations = nn.ModuleList(ACTIVATIONS[layer.activation]() for layer in shape.layers[:-1])
        for module in self.modules():
            if isinstance(module, nn.Linear):  # what SELU needs to keep its variance (LeCun)
                nn.init.normal_(module.weight, std=module.in_features**-0.5)
                nn.init.zeros_(module.bias)

    @property
    def typed_layers(self) -> list[GraphLayer]:
        """The layers, as what they are."""
        return [layer for layer in self.layers if isinstance(layer, GraphLayer)]

    def logits(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Outputs (n + 1, C) before the head, from points (n + 1, 3) and neighbors (n + 1, N)."""
        x = points
        for layer, activation in zip(self.layers, self.activations, strict=False):
            x = activation(layer(x, neighbors))
        return self.layers[-1](x, neighbors)  # type: ignore[no-any-return]

    def forward(self, points: torch.Tensor, neighbors: torch.Tensor) -> torch.Tensor:
        """Probabilities (n + 1, C) from points (n + 1, 3) and neighbors (n + 1, N)."""
        logits = self.logits(points, neighbors)
        return logits.softmax(dim=1) if self.shape.layers[-1].activation == "softmax" else logits.sigmoid()


def _make(layer: Layer, inputs: int, neighbors: int) -> GraphLayer:
    if layer.kind == "dense":
        return Dense(inputs, layer.width)
    kind = GraphConvolution if layer.kind == "convolution" else SeparableConvolution
    return kind(inputs, layer.width, neighbors)
