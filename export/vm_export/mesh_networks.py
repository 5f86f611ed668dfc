"""The two kinds of mesh networks: on a graph of points, and on a canvas of strips."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .canvas_network import CanvasNetwork
from .canvas_shape import CanvasShape
from .network import Network
from .network_shape import NetworkShape

MeshNetwork = Network | CanvasNetwork

MeshShape = NetworkShape | CanvasShape


def new_network(shape: MeshShape) -> MeshNetwork:
    """A network of this shape with random weights."""
    return CanvasNetwork(shape) if isinstance(shape, CanvasShape) else Network(shape)


def read_shape(data: Mapping[str, Any]) -> MeshShape:
    """The shape of a network from the plain values of a checkpoint. Raises InputError."""
    return NetworkShape.from_dict(data) if "layers" in data else CanvasShape.from_dict(data)
