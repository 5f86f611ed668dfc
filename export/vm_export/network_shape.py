"""The shape of a network: its layers, as plain values. This module does not need torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from vm_embedded.errors import InputError, unknown
from vm_embedded.mesh.dilation import distinct_dilations
from vm_embedded.network.manifest import MOST_DILATION

ACTIVATIONS = ("selu", "relu", "elu", "tanh")
HEADS = ("softmax", "sigmoid")
KINDS = ("convolution", "separable", "dense")


@dataclass(frozen=True)
class Layer:
    """One layer: its kind (one of KINDS), its width, and its activation (of ACTIVATIONS; the last layer: of HEADS).

    dilation: how many steps away a convolution looks (mesh/dilation.py); 1 for its point's neighbors and dense layers.
    """

    kind: str
    width: int
    activation: str
    dilation: int = 1

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(unknown("kind of layer", self.kind, KINDS))
        if self.activation not in (*ACTIVATIONS, *HEADS):
            raise InputError(unknown("activation", self.activation, (*ACTIVATIONS, *HEADS)))
        if self.width < 1:
            raise InputError(f"the width of a layer must be at least 1, not {self.width}")
        if not 1 <= self.dilation <= MOST_DILATION or (self.kind == "dense" and self.dilation > 1):
            raise InputError(
                f"the dilation of a layer must be from 1 to {MOST_DILATION}, and 1 if it is dense, not {self.dilation}"
            )


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
        dilations: Sequence[int] = (),
    ) -> NetworkShape:
        """`depth` convolutions, all but the last one of `width` channels.

        The networks of the paper (section "Network Architecture"). dilations: one for each convolution; empty if all
        are 1, as in the paper.
        """
        layers = (*(Layer(kind, width, activation),) * (depth - 1), Layer(kind, classes, head))
        spaced = zip(layers, dilations or (1,) * depth, strict=True)
        return cls(tuple(replace(layer, dilation=dilation) for layer, dilation in spaced), neighbors)

    @property
    def classes(self) -> int:
        """Number of outputs."""
        return self.layers[-1].width

    @property
    def layer_dilations(self) -> tuple[int, ...]:
        """The dilations of the convolutions, as in the manifest: empty if all are 1."""
        each = tuple(layer.dilation for layer in self.layers if layer.kind != "dense")
        return each if max(each) > 1 else ()

    @property
    def dilations(self) -> tuple[int, ...]:
        """The different dilations, as with_dilations takes them."""
        return distinct_dilations(self.layer_dilations)

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
