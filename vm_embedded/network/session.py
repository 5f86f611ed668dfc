"""The mesh network of a model file, ready to run."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from ..arrays import Mask, Singles
from ..errors import ModelError
from ..mesh.mesh import Mesh
from .choose_layout import choose_layout
from .layout import Layout
from .manifest import Manifest
from .model_file import ModelFile
from .onnx_model import Interface, OnnxModel, usable_threads
from .self_test import SelfTest
from .split_layout import SplitLayout, sectors_of

_WORTH_A_THREAD = 30e6
"""Multiplications and additions for which another thread may pay: about a millisecond. Waking it takes 0.1 ms."""

_LARGEST_SECTOR = 0.75
"""Share of a mesh's points. In a small view, the surroundings of a sector are most of the other sectors."""


class Session:
    """A loaded mesh network.

    threads: never more than this process may use. With several, a large network runs on sectors of the mesh at the same
    time (split_layout.py), each in one thread of ONNX Runtime; in the layout canvas, ONNX Runtime splits each operator
    instead. spinning: see OnnxModel; it only matters in this layout. Loading runs the model's self-test. Raises
    ModelError if the file does not load, has other inputs and outputs than its manifest says, or fails its self-test.
    """

    def __init__(self, model: ModelFile, threads: int = 1, spinning: bool = False) -> None:
        self.model = model
        self.threads = usable_threads(threads)
        self._process = os.getpid()
        is_split = self.threads > 1 and model.manifest.layout != "canvas"
        self._others = ThreadPoolExecutor(self.threads - 1, "network") if is_split else None
        interface = _interface(model.manifest)
        inside = 1 if is_split else self.threads
        self.onnx = OnnxModel(model.path, model.content, interface, "probabilities", inside, spinning)
        if model.manifest.self_test is not None:
            self._check(model.manifest.self_test)

    def arrange(self, mesh: Mesh) -> Layout:
        """A mesh in the order that the network takes it, in sectors if it has several threads and they pay."""
        manifest = self.model.manifest
        if self._others is None:
            return choose_layout(mesh, manifest)
        count = min(self.threads, int(manifest.operations * len(mesh) / _WORTH_A_THREAD))
        if count < 2:
            return choose_layout(mesh, manifest)
        sectors = sectors_of(mesh, count, self.model.depth)
        if max(len(each.members) for each in sectors) > _LARGEST_SECTOR * len(mesh):
            return choose_layout(mesh, manifest)
        return SplitLayout(mesh, sectors, lambda part: choose_layout(part, manifest), self._others)

    def run(self, layout: Layout, colors: Singles, on_screen: Mask) -> Singles:
        """Answers (m, outputs) to a layout's slots, from their colors (3, m) and which slots (m,) are on screen.

        Raises ModelError, also if the system has no thread left, for answers that are not finite, and for several
        threads in a process that was forked after the model was loaded.
        """
        if self.threads > 1 and os.getpid() != self._process:  # it would wait forever: a fork has no other threads
            raise ModelError(
                f"{self.model.path}: its {self.threads} threads belong to another process; "
                "load the detector in each process, or use one thread"
            )
        try:
            answers = layout.answers(self.onnx.run, colors, on_screen)
        except RuntimeError as error:
            raise ModelError(f"{self.model.path}: can't run it in {self.threads} threads: {error}") from error
        if not (np.isfinite(answers).all(axis=1) | ~on_screen).all():
            raise ModelError(f"{self.model.path}: its answers are NaN or infinite")
        return answers

    def answer(self, test: SelfTest) -> Singles:
        """Answers (n, outputs) to an example's points."""
        mesh = Mesh(np.zeros((len(test.points) - 1, 3)), test.neighbors, test.cells)
        # In an example a missing neighbor is always the off-screen point, also for networks with another edge policy.
        layout = choose_layout(mesh, replace(self.model.manifest, edge="hard"))
        colors = test.points[layout.slots].T
        return self.run(layout, colors, layout.slots < len(mesh))[layout.places]

    def _check(self, test: SelfTest) -> None:
        """Run the model's own example. Raises ModelError if the answer differs from the exporter's."""
        manifest = self.model.manifest
        if test.neighbors.shape[1] != manifest.neighbors:
            raise ModelError(
                f"{self.model.path}: self-test has {test.neighbors.shape[1]} neighbors for each point, "
                f"its mesh {manifest.mesh} has {manifest.neighbors}"
            )
        if manifest.layout == "canvas" and test.cells is None:
            raise ModelError(f"{self.model.path}: self-test lacks the cells of its points on strips")
        self.onnx.check_answer(self.answer(test), test.probabilities[:-1])


def _interface(manifest: Manifest) -> Interface:
    """The inputs and outputs of a mesh network, which depend on its layout."""
    outputs = manifest.outputs
    if manifest.layout == "canvas":
        return {
            "points": ("tensor(float)", [1, 3]),
            "shown": ("tensor(bool)", [1, 1]),
            "probabilities": ("tensor(float)", [1, outputs]),
        }
    interface: Interface = {"points": ("tensor(float)", [3]), "probabilities": ("tensor(float)", [outputs])}
    if manifest.layout == "plain":
        interface["neighbors"] = ("tensor(int32)", [manifest.neighbors])
    else:
        interface["columns"] = ("tensor(int64)", [len(manifest.model.groups)])
    return interface
