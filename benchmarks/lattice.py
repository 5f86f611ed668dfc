"""Grids without neighbor indices against rings: one call of the same network in each layout, interleaved on one core.

python -m benchmarks.lattice
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from vm_embedded import Equisolid, Orientation
from vm_embedded.detection.projection import project
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.manifest import Manifest, ObjectClass
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import Session
from vm_export.checkpoint import Checkpoint
from vm_export.export import export
from vm_export.network import Network
from vm_export.network_shape import NetworkShape

from .timing import interleaved

ROUNDS = 300
CASES = (("ring6", "runs"), ("ring6", "plain"), ("xygrid6", "lattice"), ("xmgrid6", "lattice"), ("xmgrid6", "runs"))
NETWORKS = ((5, 4), (9, 4), (12, 16))
HEIGHT, SIZE = 0.8, (1280, 1024)


def main() -> None:
    os.sched_setaffinity(0, [max(os.sched_getaffinity(0))])
    lens, pose = Equisolid(focal_length=420.0, fov=2.6), Orientation.from_roll_pitch(HEIGHT, pitch=0.5)
    print("network  mesh     layout    points   slots  median [ms]  p99 [ms]  for 1000 points [us]")
    for depth, width in NETWORKS:
        calls, sizes = {}, {}
        for model, layout in CASES:
            name = f"{model:8s} {layout:8s}"
            calls[name], sizes[name] = _call(depth, width, model, layout, lens, pose)
        for name, found in interleaved(calls, ROUNDS).items():
            points, slots = sizes[name]
            print(
                f"{depth:2d}x{width:<4d}  {name} {points:7d} {slots:7d}  {found['p50']:11.3f}  {found['p99']:8.3f}  "
                f"{1e6 * found['p50'] / points:20.0f}"
            )


def _call(depth, width, model, layout, lens, pose):
    """A call of a network on the visible part of a mesh, its number of points, and its number of slots."""
    facts = Manifest(
        shape="sphere",
        radius=0.095,
        object_radius=0.095,
        intersections=4.0,
        mesh=model,
        max_distance=10.0,
        edge="hard",
        classes=(ObjectClass("ball", "object"), ObjectClass("other", "background")),
    )
    torch.manual_seed(0)
    made = Checkpoint(Network(NetworkShape.uniform(depth, width, 2)).eval(), facts)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.onnx"
        export(made, path, layout)
        session = Session(read_model(path))
    whole = facts.model.build(facts.mesh_shape, HEIGHT, 4.0, 10.0)
    mesh = project(whole, pose.level, lens, SIZE).visible.graph
    arranged = choose_layout(mesh, replace(facts, layout=layout))
    colors = np.random.default_rng(0).random((3, len(arranged.slots)), dtype=np.float32)
    shown = arranged.slots < len(mesh)
    return lambda: session.run(arranged, colors, shown), (len(mesh), len(shown))


if __name__ == "__main__":
    main()
