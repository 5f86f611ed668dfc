"""From a torch network to self-describing ONNX files, checked against torch."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

import vm_embedded
from vm_embedded.arrays import Indices, Singles
from vm_embedded.errors import ModelError
from vm_embedded.files import atomic_write
from vm_embedded.mesh.grids import lattice_neighbors
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import ModelFile
from vm_embedded.network.self_test import SelfTest
from vm_embedded.network.session import Session

from .checkpoint import Checkpoint
from .lattice_graph import lattice_graph
from .network import Network
from .plain_graph import plain_graph
from .runs_graph import runs_graph
from .second_look import SecondLook

LARGEST_DIFFERENCE = 1e-4
"""Probability by which ONNX Runtime may differ from torch."""

_WIDEST = {"convolution": 64, "separable": 32, "dense": 1024}
"""Width of a layer of each kind up to which layout runs is chosen: where it was measured to be faster, for convolutions
and separable ones (docs/performance.md); dense layers have no look-ups, so their width hardly matters."""

_CHECKED_POINTS = (1, 2, 7, 64, 1000, 5000)


def fastest_layout(checkpoint: Checkpoint) -> str:
    """The fastest layout that a network can have, by its shape.

    Runs save look-ups and cost multiplications: two in nine of a convolution's are by zero, and separable ones become
    full ones. So the wider a layer, the less they gain. A second look there is only in runs.
    """
    if isinstance(checkpoint.network, SecondLook):
        return "runs"
    narrow = all(layer.width <= _WIDEST[layer.kind] for layer in checkpoint.network.shape.layers)
    return "runs" if narrow and checkpoint.manifest.edge == "hard" else "plain"


def build(network: Network | SecondLook, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model in the manifest's layout: stock operators, the neighbor indices an input.

    Raises ModelError for a second look in another layout than runs, and for a layout that the mesh can't have.
    """
    if manifest.layout == "runs":
        return runs_graph(network, manifest)
    if isinstance(network, SecondLook):
        raise ModelError(f"a network with a second look is written in layout runs, not {manifest.layout}")
    return lattice_graph(network, manifest) if manifest.layout == "lattice" else plain_graph(network, manifest)


def export(checkpoint: Checkpoint, path: str | Path, layout: str | None = None) -> float:
    """Write the model file of a checkpoint, in the fastest layout if none is given; return the difference to torch.

    The file is checked in ONNX Runtime before it is written. Raises ModelError if a probability differs by more than
    LARGEST_DIFFERENCE, or for a layout that does not fit the manifest; InputError if the file can't be written.
    """
    layout = layout or fastest_layout(checkpoint)
    network = checkpoint.network.eval()
    provenance = {**checkpoint.manifest.provenance, "exported_by": f"vm-export {vm_embedded.__version__}"}
    manifest = replace(
        checkpoint.manifest,
        layout=layout,
        operations=network.operations,
        provenance=provenance,
    )
    manifest = replace(manifest, self_test=_example(network, manifest, points=12, seed=0))
    content = build(network, manifest)
    difference = largest_difference(content, network, manifest)
    if not difference <= LARGEST_DIFFERENCE:
        raise ModelError(
            f"not written: ONNX Runtime and torch differ by {difference:.2g}, allowed are {LARGEST_DIFFERENCE:g}"
        )
    with atomic_write(Path(path)) as part:
        part.write_bytes(content)
    return difference


def largest_difference(content: bytes, network: Network | SecondLook, manifest: Manifest) -> float:
    """Largest difference of a probability between ONNX Runtime and torch, over several numbers of points."""
    session = Session(ModelFile(Path("the new model"), content, replace(manifest, self_test=None), ""))
    worst = 0.0
    for seed, points in enumerate(_CHECKED_POINTS):
        test = _example(network, manifest, points, seed)
        worst = max(worst, float(np.abs(session.answer(test) - test.probabilities[:-1]).max()))
    return worst


def _example(network: Network | SecondLook, manifest: Manifest, points: int, seed: int) -> SelfTest:
    """Random colors on a random graph of `points` points, rounded as the manifest does, and torch's answer.

    For layout lattice the graph is a random part of a square of it.
    """
    random = np.random.default_rng(seed)
    colors: Singles = np.full((points + 1, 3), -1.0, dtype=np.float32)
    colors[:-1] = np.round(random.random((points, 3)), 4)
    neighbors: Indices = random.integers(0, points + 1, (points + 1, network.shape.neighbors)).astype(np.int32)
    neighbors[-1] = points
    cells: Indices | None = None
    if manifest.layout == "lattice":
        assert manifest.model.steps is not None  # the graph is written
        side = math.ceil(math.sqrt(1.5 * points))
        chosen = np.sort(random.choice(side * side, points, replace=False))
        cells = np.stack([chosen % side, chosen // side], axis=1).astype(np.int32)
        neighbors = lattice_neighbors(cells, manifest.model.steps)
    with torch.inference_mode():
        answer = network(torch.from_numpy(colors), torch.from_numpy(neighbors)).numpy()
    return SelfTest(colors, neighbors, answer, cells)
