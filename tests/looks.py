"""Contracts of look networks, and a small look network whose answers anybody can compute."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from tests.manifests import ball_manifest
from vm_embedded.arrays import Image, Singles
from vm_embedded.network.look_contract import LookContract, look_key
from vm_embedded.network.look_example import ANSWERS
from vm_embedded.network.manifest import METADATA_KEY, Manifest

MIXTURE = np.array([[0.001, 0.002, 0.003, 0.0], [0.0, 0.001, -0.002, 0.004], [0.002, 0.0, 0.0, 0.001]])
"""Answers of `small_look` to a patch whose mean color is (1, 0, 0), (0, 1, 0) or (0, 0, 1)."""


def look_contract(**changes: Any) -> LookContract:
    """A contract for balls in patches of 8 x 8 samples, or with other entries."""
    entries = {"object_class": "ball", "size": 8, "extent": 1.75, "max_proposals": 10}
    return LookContract(**(entries | changes))


def random_patches(count: int, size: int = 8, seed: int = 0) -> Image:
    """Patches (count, size, size, 3) of noise."""
    return np.random.default_rng(seed).integers(0, 256, (count, size, size, 3), dtype=np.uint8)


def small_answers(patches: Image) -> Singles:
    """The answers (n, 4) of `small_look`."""
    return (patches.mean(axis=(1, 2)) @ MIXTURE).astype(np.float32)


def small_look(size: int = 8, width: int = len(ANSWERS)) -> bytes:
    """A look network that mixes the mean color of a patch into `width` answers."""
    from vm_export.onnx_graph import FLOAT, UINT8, OnnxGraph

    graph = OnnxGraph()
    colors = graph.node("Cast", ["patches"], "colors", to=FLOAT)
    mean = graph.node("ReduceMean", [colors], "mean", axes=[1, 2], keepdims=0)
    graph.node("MatMul", [mean, graph.constant("mixture", MIXTURE[:, :width])], "answers")
    return graph.model({"patches": (UINT8, ["n", size, size, 3])}, {"answers": (FLOAT, ["n", width])}, {}, "a test")


def model_with(look: bytes | str | None, manifest: Manifest) -> bytes:
    """A model file whose mesh network nobody runs, with these bytes or this text as its look network at balls."""
    from vm_export.onnx_graph import FLOAT, OnnxGraph

    graph, metadata = OnnxGraph(), {METADATA_KEY: manifest.as_json()}
    graph.node("Identity", ["points"], "probabilities")
    if look is not None:
        metadata[look_key("ball")] = look if isinstance(look, str) else base64.b64encode(look).decode()
    return graph.model({"points": (FLOAT, ["n", 3])}, {"probabilities": (FLOAT, ["n", 3])}, metadata, "a test")


def ball_manifest_with_look(**changes: Any) -> Manifest:
    """A manifest for balls with a close look, whose contract may have other entries."""
    return ball_manifest(mesh="octaves", peaks=("ball",), looks=(look_contract(**changes),))
