"""The self-test of a mesh network: points that it finds clear examples of each class, and points that it is unsure of.

Random colors tell a network little: it gives all of them nearly the same answer, and a network whose weights are lost
may give that answer, too. So the colors are fitted to the network, by descending the gradient of its loss.
"""

from __future__ import annotations

import numpy as np
import torch

from vm_embedded.arrays import Indices, Singles
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.example import SelfTest
from vm_embedded.network.layout import OFF_SCREEN
from vm_embedded.network.manifest import Manifest

from .canvas_network import CanvasNetwork
from .mesh_networks import MeshNetwork, model_outputs

_HOPS = 3
"""Links from the middle of a patch to its edge: ring6 gets patches of about 37 points."""

_STEPS, _RATE = 150, 0.2
"""Number of steps, and the size of the first one. They become shorter. A step takes only the gradient's signs: points
that hardly matter move, too. The optimizers of torch would do as well, but take a second to import."""

_RANGES = {"absolute": (0.0, 1.0), "relative": (-3.0, 3.0)}
"""Colors that points of each kind of POINT_COLORS can have; relative ones are rarely farther from 0."""


def strong_self_test(network: MeshNetwork, manifest: Manifest) -> SelfTest:
    """An example for a network and its answer: a few separate patches of the manifest's mesh.

    For each class, one patch has colors with which the network is as sure of this class as it can be, and one patch has
    colors with which it is unsure between this class and the next. The same network gives the same example.
    """
    wanted = _wanted(len(manifest.classes))
    patch = _patch(manifest)
    neighbors, cells = _repeated(patch, len(wanted))
    around = neighbors if cells is None else cells
    colors = _fitted_colors(network, around, np.repeat(wanted, len(patch), axis=0), _RANGES[manifest.colors])
    with torch.inference_mode():
        answer = model_outputs(network, torch.from_numpy(colors), torch.from_numpy(around)).numpy()
    return SelfTest(colors, neighbors, answer, cells)


def _wanted(classes: int) -> Singles:
    """The probabilities (patches, C) that the points of each patch should get."""
    sure: Singles = np.eye(classes, dtype=np.float32)
    return np.concatenate([sure, (sure + np.roll(sure, 1, axis=1)) / 2.0])


def _patch(manifest: Manifest) -> Mesh:
    """The points of a small mesh that are at most _HOPS links from one in its middle."""
    height = manifest.object_height + 10.0 * manifest.radius
    reach = min(manifest.max_distance, 100.0 * manifest.radius)
    mesh = manifest.model.build(manifest.mesh_shape, height, manifest.intersections, reach)
    kept = np.array([len(mesh) // 2])
    for _ in range(_HOPS):
        kept = np.unique([*kept, *mesh.neighbors[kept].ravel()])
        kept = kept[kept < len(mesh)]
    return mesh.part(kept)


def _repeated(patch: Mesh, count: int) -> tuple[Indices, Indices | None]:
    """The neighbors (n + 1, N) of the points of `count` separate copies of a patch, and their cells (n, 2), if any."""
    size = len(patch)
    links = patch.neighbors[:-1]
    copies = [np.where(links == size, count * size, links + copy * size) for copy in range(count)]
    edge = np.full((1, links.shape[1]), count * size)
    neighbors: Indices = np.concatenate([*copies, edge]).astype(np.int32)
    if patch.cells is None:
        return neighbors, None
    own = patch.cells - patch.cells.min(axis=0)
    apart = np.array([own[:, 0].max() + 2, 0])
    return neighbors, np.concatenate([own + copy * apart for copy in range(count)]).astype(np.int32)


def _fitted_colors(network: MeshNetwork, around: Indices, wanted: Singles, limits: tuple[float, float]) -> Singles:
    """Colors (n + 1, 3), rounded as SelfTest.as_dict rounds, whose answers are close to `wanted` (n, C).

    around: neighbors (n + 1, N), or for a network on a canvas cells (n, 2). limits: smallest and largest color.
    """
    low, high = limits
    links, target = torch.from_numpy(around), torch.from_numpy(wanted)
    off_screen = torch.full((1, 3), float(OFF_SCREEN))
    random = np.random.default_rng(0).normal(0.0, 0.3, (len(wanted), 3))
    free = torch.from_numpy(random.astype(np.float32)).requires_grad_()

    def colors() -> torch.Tensor:
        return torch.cat([low + (high - low) * (1.0 + torch.tanh(free)) / 2.0, off_screen])

    softmax = isinstance(network, CanvasNetwork) or network.shape.layers[-1].activation == "softmax"
    functional = torch.nn.functional
    loss = functional.cross_entropy if softmax else functional.binary_cross_entropy_with_logits
    for step in range(_STEPS):
        logits = network.logits(colors(), links)[:-1, : target.shape[1]]
        (gradient,) = torch.autograd.grad(loss(logits, target), free)
        with torch.no_grad():
            free -= _RATE * (1.0 - step / _STEPS) * gradient.sign()
    return np.round(colors().detach().numpy().astype(float), 4).astype(np.float32)
