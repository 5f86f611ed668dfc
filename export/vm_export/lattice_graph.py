"""The graph of the layout `lattice`: ordinary convolutions of 3 x 3 pixels, and no look-ups.

vm_embedded/network/lattice_layout.py prepares its inputs. The points of a grid become the pixels of a picture. The
off-screen point is a pixel with only gaps around it: it goes through every layer, and before each convolution all
pixels off screen get its value.
"""

from __future__ import annotations

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.errors import ModelError
from vm_embedded.network.manifest import METADATA_KEY, Manifest

from .column_layers import write_layers
from .network import Network
from .onnx_graph import BOOL, FLOAT, OnnxGraph


def lattice_model(network: Network, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model in the layout `lattice`.

    Inputs: points (3, rows * columns) float32 and shown (rows, columns) bool, as LatticeLayout gives them. Output:
    probabilities (C, rows * columns) float32. Raises ModelError for a mesh whose neighbors are not at fixed steps.
    """
    steps = manifest.model.steps
    if steps is None:
        raise ModelError(
            f"layout lattice needs a grid, whose neighbors are at fixed steps; mesh {manifest.mesh} is not"
        )
    graph = OnnxGraph()
    size = graph.node("Shape", ["shown"], "size")
    shown = graph.node("Reshape", ["shown", graph.constant("row", [1, -1])], "shown.row")
    # The off-screen point is the second pixel of the second row, so its place is the width plus one.
    width = graph.node("Gather", [size, graph.constant("second", [1])], "width")
    off_screen_point = graph.node("Add", [width, graph.constant("one", [1])], "nowhere")

    def convolve(name: str, x: str, kernel: Floats) -> str:
        outputs, _, inputs = kernel.shape
        if x != "points":  # the input already has -1 off screen
            instead = graph.node("Gather", [x, off_screen_point], f"{name}.instead", axis=1)
            x = graph.node("Where", [shown, x, instead], f"{name}.masked")
        taps = np.zeros((outputs, inputs, 3, 3))
        for place, (right, up) in enumerate(((0, 0), *steps)):
            taps[:, :, 1 + up, 1 + right] = kernel[:, place]
        batch = graph.constant(f"{name}.batch", [1, inputs])
        shape = graph.node("Concat", [batch, size], f"{name}.picture.shape", axis=0)
        picture = graph.node("Reshape", [x, shape], f"{name}.picture")
        weights = graph.constant(f"{name}.kernel", taps)
        sums = graph.node("Conv", [picture, weights], f"{name}.sums", kernel_shape=[3, 3], pads=[1, 1, 1, 1])
        return graph.node("Reshape", [sums, graph.constant(f"{name}.flat", [outputs, -1])], f"{name}.summed")

    write_layers(graph, network, convolve)
    return graph.model(
        {"points": (FLOAT, [3, "places"]), "shown": (BOOL, ["rows", "columns"])},
        {"probabilities": (FLOAT, [network.shape.classes, "places"])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network on a lattice, laid out as a picture. vm_embedded prepares it.",
    )
