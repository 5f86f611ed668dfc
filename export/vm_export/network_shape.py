"""The shape of a network: its layers, as plain values. This module does not need torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from vm_embedded.errors import InputError, unknown

ACTIVATIONS = ("selu", "relu", "elu", "tanh")
HEADS = ("softmax", "sigmoid")
KINDS = ("convolution", "separable", "dense")


@dataclass(frozen=True)
class Layer:
    """One layer: its kind (one of KINDS), its width, and its activation (of ACTIVATIONS; the last layer: of HEADS)."""

    kind: str
    width: int
    activation: str

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(unknown("kind of layer", self.kind, KINDS))
        if self.activation not in (*ACTIVATIONS, *HEADS):
            raise InputError(unknown("activation", self.activation, (*ACTIVATIONS, *HEADS)))
        if self.width < 1:
            raise InputError(f"the width of a layer must be at least 1, not {self.width}")


@dataclass(frozen=True)
class NetworkShape:
    """The layers of a network for points with three color channels and `neighbors` neighbors each.

    Raises InputError if the first layer is dense, or if a head is not the last layer.
    """

    layers: tuple[Layer, ...]
    neighbors: int = 6

    def __post_init__(self) -> None:
        if not self.layers or self.layers[0].kind == "dense":
            raise InputError("the first layer of a network must be a convolution or separable")
        heads = [layer.activation in HEADS for layer in self.layers]
        if not heads[-1] or any(heads[:-1]):
            raise InputError(f"the last layer of a network, and no other, must have activation {' or '.join(HEADS)}")

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
        """`depth` convolutions, all but the last one of `width` channels.

        The networks of the paper (section "Network Architecture").
        """
        inner = (Layer(kind, width, activation),) * (depth - 1)
        return cls((*inner, Layer(kind, classes, head)), neighbors)

    @property
    def classes(self) -> int:
        """Number of outputs."""
        return self.layers[-1].width

    @property
    def summary(self) -> str:
        """The shape in two words."""
        return f"{len(self.layers)} layers"

    @property
    def operations(self) -> int:
        """Multiplications and additions for each point, without activations."""
        total, inputs = 0, 3
        for layer in self.layers:
            # With six neighbors 7 places, where a 3 x 3 convolution has 9 (paper: section "Network").
            places = 1 if layer.kind == "dense" else self.neighbors + 1
            mixed = places * inputs * layer.width if layer.kind == "convolution" else inputs * layer.width
            total += 2 * (mixed + (places * inputs if layer.kind == "separable" else 0))
            inputs = layer.width
        return total

    def as_dict(self) -> dict[str, Any]:
        """The shape as plain values for a checkpoint."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> NetworkShape:
        """Inverse of `as_dict`. Raises InputError."""
        try:
            return cls(tuple(Layer(**layer) for layer in data["layers"]), int(data["neighbors"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"can't read the shape of a network: {error}") from error
