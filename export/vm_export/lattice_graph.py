"""The graph for lattices: ordinary convolutions of 3 x 3, and no look-ups; see vm_embedded/network/lattice_layout.py.

The off-screen point is a place in the picture that has only gaps around it. It goes through every layer, and before
each convolution all that is off screen gets its value.
"""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import ModelError
from vm_embedded.network.manifest import METADATA_KEY, Manifest

from .column_layers import column_layers
from .graph import BOOL, FLOAT, Graph
from .network import Network


def lattice_graph(network: Network, manifest: Manifest) -> bytes:
    """An ONNX model of the network.

    Inputs: points (3, rows * columns) float32 and shown (rows, columns) bool, as LatticeLayout gives them. Output:
    probabilities (C, rows * columns) float32. Raises ModelError for a mesh whose neighbors are no fixed steps away.
    """
    steps = manifest.model.steps
    if steps is None:
        raise ModelError(f"layout lattice is for grids, whose neighbors are fixed steps away; {manifest.mesh} is none")
    graph = Graph()
    size = graph.node("Shape", ["shown"], "size")
    shown = graph.node("Reshape", ["shown", graph.constant("row", [1, -1])], "shown.row")
    width = graph.node("Gather", [size, graph.constant("second", [1])], "width")
    nowhere = graph.node("Add", [width, graph.constant("one", [1])], "nowhere")  # the second place of the second row

    def convolve(name: str, x: str, kernel: Floats) -> str:
        outputs, _, inputs = kernel.shape
        if x != "points":  # those are -1 off screen as they come
            instead = graph.node("Gather", [x, nowhere], f"{name}.instead", axis=1)
            x = graph.node("Where", [shown, x, instead], f"{name}.masked")
        taps = np.zeros((outputs, inputs, 3, 3))
        for place, (right, up) in enumerate(((0, 0), *steps)):
            taps[:, :, 1 + up, 1 + right] = kernel[:, place]
        batch = graph.constant(f"{name}.batch", [1, inputs])
        picture = graph.node("Concat", [batch, size], f"{name}.picture.shape", axis=0)
        seen = graph.node("Reshape", [x, picture], f"{name}.picture")
        weights = graph.constant(f"{name}.kernel", taps)
        sums = graph.node("Conv", [seen, weights], f"{name}.sums", kernel_shape=[3, 3], pads=[1, 1, 1, 1])
        return graph.node("Reshape", [sums, graph.constant(f"{name}.flat", [outputs, -1])], f"{name}.summed")

    column_layers(graph, network, "points", convolve, "", "probabilities")
    return graph.model(
        {"points": (FLOAT, [3, "places"]), "shown": (BOOL, ["rows", "columns"])},
        {"probabilities": (FLOAT, [network.shape.classes, "places"])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network on a lattice, laid out as a picture. vm_embedded prepares it.",
    )
