"""Contracts of look networks, and a small look network whose answers anybody can compute."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from tests.manifests import ball_manifest
from vm_embedded.arrays import Floats, Image, Singles
from vm_embedded.network.look_contract import LOOK_KEY, JudgedClass, LookContract
from vm_embedded.network.look_example import ANSWERS
from vm_embedded.network.manifest import METADATA_KEY, Manifest

MIXTURE = np.array([[0.001, 0.002, 0.003, 0.0], [0.0, 0.001, -0.002, 0.004], [0.002, 0.0, 0.0, 0.001]])
"""Answers of `small_look` for its first class to a patch whose mean color is (1, 0, 0), (0, 1, 0) or (0, 0, 1)."""


def upright(name: str, upright_radius: float = 0.3, mesh_weight: float = 0.0) -> JudgedClass:
    """A class of uprights, of whose bases a close look sees circles of this radius [m]."""
    return JudgedClass(name=name, upright_radius=upright_radius, mesh_weight=mesh_weight)


def look_contract(*classes: JudgedClass | str, **changes: Any) -> LookContract:
    """A contract for patches of 8 x 8 samples, or with other entries.

    classes: that it judges, or the names of objects; without any, the one class ball.
    """
    judged = tuple(JudgedClass(name=each) if isinstance(each, str) else each for each in classes or ("ball",))
    entries = {"classes": judged, "size": 8, "extent": 1.75, "max_proposals": 10}
    return LookContract(**(entries | changes))


def random_patches(count: int, size: int = 8, seed: int = 0) -> Image:
    """Patches (count, size, size, 3) of noise."""
    return np.random.default_rng(seed).integers(0, 256, (count, size, size, 3), dtype=np.uint8)


def _mixtures(classes: int) -> Floats:
    """What `small_look` multiplies a mean color with (3, C, 4): each class has the colors of the one before turned."""
    return np.stack([np.roll(MIXTURE, number, axis=0) for number in range(classes)], axis=1)


def small_answers(patches: Image, classes: int = 1) -> Singles:
    """The answers (n, C, 4) of `small_look`."""
    return np.einsum("ni,icj->ncj", patches.mean(axis=(1, 2)), _mixtures(classes)).astype(np.float32)


def small_look(classes: int = 1, size: int = 8, width: int = len(ANSWERS)) -> bytes:
    """A look network that mixes the mean color of a patch into `width` answers for each class."""
    from vm_export.onnx_graph import FLOAT, UINT8, OnnxGraph

    graph = OnnxGraph()
    colors = graph.node("Cast", ["patches"], "colors", to=FLOAT)
    mean = graph.node("ReduceMean", [colors], "mean", axes=[1, 2], keepdims=0)
    mixture = graph.constant("mixture", _mixtures(classes)[..., :width].reshape(3, -1))
    mixed = graph.node("MatMul", [mean, mixture], "mixed")
    graph.node("Reshape", [mixed, graph.constant("shape", [-1, classes, width])], "answers")
    answers = {"answers": (FLOAT, ["n", classes, width])}
    return graph.model({"patches": (UINT8, ["n", size, size, 3])}, answers, {}, "a test")


def model_with(look: bytes | str | None, manifest: Manifest) -> bytes:
    """A model file whose mesh network nobody runs, with these bytes or this text as its look network."""
    from vm_export.onnx_graph import FLOAT, OnnxGraph

    graph, metadata = OnnxGraph(), {METADATA_KEY: manifest.as_json()}
    graph.node("Identity", ["points"], "probabilities")
    if look is not None:
        metadata[LOOK_KEY] = look if isinstance(look, str) else base64.b64encode(look).decode()
    return graph.model({"points": (FLOAT, ["n", 3])}, {"probabilities": (FLOAT, ["n", 3])}, metadata, "a test")


def manifest_with_look(**changes: Any) -> Manifest:
    """A manifest for balls and goals with a close look at both, whose contract may have other entries."""
    classes = ("ball", "goal:upright")
    look = look_contract("ball", upright("goal"), **changes)
    return ball_manifest(*classes, mesh="octaves", peaks=("ball", "goal"), look=look)
