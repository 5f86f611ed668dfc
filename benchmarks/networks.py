"""Visual Mesh networks to measure, with random weights, and a loop of numpy calls for comparison."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from vm_embedded.arrays import Indices, Singles
from vm_embedded.network.manifest import Manifest, ObjectClass
from vm_embedded.network.model_file import ModelFile, read_model
from vm_export.checkpoint import Checkpoint
from vm_export.export import export
from vm_export.network import Network
from vm_export.network_shape import Layer, NetworkShape

REFERENCE = NetworkShape(
    (
        *(Layer("convolution", 16, "selu"),) * 7,
        *(Layer("convolution", 8, "selu"),) * 5,
        Layer("convolution", 5, "softmax"),
    )
)
"""The network of the paper's authors: 7 layers of 16, 5 of 8, 5 classes."""

NETWORKS = {
    "3x4": (NetworkShape.uniform(3, 4, 2), 4.0, 10.0),
    "5x4": (NetworkShape.uniform(5, 4, 2), 4.0, 10.0),
    "9x4": (NetworkShape.uniform(9, 4, 2), 4.0, 10.0),
    "13x16": (REFERENCE, 6.0, 20.0),
}
"""Name: shape, intersections, maximum distance [m]. The first three have the paper's depths (section "Network
Architecture"): a layer sees one ring farther, and at k = 4 a ball's radius is two rings."""


def checkpoint(shape: NetworkShape, intersections: float, max_distance: float) -> Checkpoint:
    """A network with random weights that finds nothing: its only object class stays far below the threshold."""
    torch.manual_seed(0)
    network = Network(shape).eval()
    with torch.no_grad():
        network.typed_layers[-1].linear.bias[-1] -= 20.0
    kinds = ["background"] * (shape.classes - 1) + ["object"]
    manifest = Manifest(
        shape="sphere",
        radius=0.095,
        object_radius=0.095,
        intersections=intersections,
        mesh="ring6",
        max_distance=max_distance,
        edge="hard",
        classes=tuple(ObjectClass(f"class{number}", kind) for number, kind in enumerate(kinds)),
    )
    return Checkpoint(network, manifest)


def model_file(made: Checkpoint, path: Path) -> ModelFile:
    """The checkpoint as vm-export writes it."""
    export(made, path)
    return read_model(path)


class NumpyLoop:
    """The same network as a loop over its layers: take, matmul and SELU in numpy, into arrays that are reused."""

    def __init__(self, network: Network, points: int) -> None:
        self.layers = [
            (layer.linear.weight.detach().numpy().T.copy(), layer.linear.bias.detach().numpy())
            for layer in network.typed_layers
        ]
        places = network.shape.neighbors + 1
        self._gathered = [np.empty((points + 1, len(kernel)), dtype=np.float32) for kernel, _ in self.layers]
        self._sums = [np.empty((points + 1, len(bias)), dtype=np.float32) for _, bias in self.layers]
        self._places = places

    def run(self, points: Singles, neighbors: Indices) -> Singles:
        """Probabilities (n + 1, C) from points (n + 1, 3) and neighbors (n + 1, N + 1), self first."""
        x = points
        for number, (kernel, bias) in enumerate(self.layers):
            gathered, z = self._gathered[number], self._sums[number]
            np.take(x, neighbors, axis=0, out=gathered.reshape(len(x), self._places, -1), mode="clip")
            np.matmul(gathered, kernel, out=z)
            z += bias
            if number < len(self.layers) - 1:
                below = np.minimum(z, 0.0)
                np.exp(below, out=below)
                below -= 1.0
                below *= 1.6732632423543772
                np.maximum(z, 0.0, out=z)
                z += below
                z *= 1.0507009873554805
            x = z
        np.exp(x, out=x)
        x /= x.sum(axis=1, keepdims=True)
        return x
