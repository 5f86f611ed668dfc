"""The graph of a look network: ordinary convolutions on patches.

The colors of a patch stay as they lie in memory: row by row, the three colors of a sample side by side. The first
convolution takes that as a picture of one channel with three columns for each sample. So its kernel of 3 x 3 samples
has 3 rows and 9 columns, its step of two samples is six columns, and no operator has to sort the colors into channels.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.network.look_example import ANSWERS

from .eight_bits import integers_of
from .look_network import FIRST_OF_SUM, LAST_OF_SUM, NOISE_FLOOR, LookNetwork
from .onnx_graph import FLOAT, UINT8, OnnxGraph


def look_model(network: LookNetwork) -> bytes:
    """The bytes of an ONNX model. Input: patches (n, size, size, 3) uint8. Output: answers (n, C, 4) float32."""
    graph, size = OnnxGraph(), network.shape.size
    weights = {name: value.detach().double().numpy() for name, value in network.state_dict().items()}
    before = x = _write_normalization(graph, size)
    for index, layer in enumerate(network.typed_convolutions):
        kernel, bias = weights[f"convolutions.{index}.weight"], weights[f"convolutions.{index}.bias"]
        side, step, columns = layer.kernel_size[0], layer.stride[0], 1
        if index == 0:
            kernel, columns = kernel.transpose(0, 2, 3, 1).reshape(-1, 1, 3, 9), 3
        geometry = {
            "kernel_shape": [side, side * columns],
            "pads": [side // 2, side // 2 * columns] * 2,
            "strides": [step, step * columns],
            "group": layer.groups,
        }
        if index == FIRST_OF_SUM:
            before = x
        x = _write_layer(graph, "Conv", f"layer{index}", x, kernel, bias, **geometry)
        x = graph.node("Relu", [x], f"layer{index}.activation")
        if index == LAST_OF_SUM:
            x = graph.node("Add", [x, before], "sum")
    x = graph.node("Flatten", [x], "flat", axis=1)
    x = _write_layer(graph, "Gemm", "hidden", x, weights["hidden.weight"], weights["hidden.bias"], transB=1)
    x = graph.node("Relu", [x], "hidden.activation")

    # The calibration, a scale and an offset of the probability's logit, becomes part of the last layer's weights.
    kernel, bias = weights["answers.weight"].copy(), weights["answers.bias"].copy()
    scale, offset = weights["calibration"].T
    count, classes = len(ANSWERS), network.shape.classes
    kernel[::count], bias[::count] = kernel[::count] * scale[:, None], bias[::count] * scale + offset
    linear = _write_layer(graph, "Gemm", "last", x, kernel, bias, transB=1)
    is_probability = graph.constant("last.is_probability", [name == "probability" for name in ANSWERS] * classes)
    chosen = [is_probability, graph.node("Sigmoid", [linear], "last.sigmoid"), linear]
    by_class = graph.constant("last.shape", [-1, classes, count])
    graph.node("Reshape", [graph.node("Where", chosen, "last.answers"), by_class], "answers")
    return graph.model(
        {"patches": (UINT8, ["n", size, size, 3])},
        {"answers": (FLOAT, ["n", classes, count])},
        {},
        "Look network of a Visual Mesh model. Of each class in each patch: probability, shift to the right and down, "
        "and log size.",
    )


def _write_normalization(graph: OnnxGraph, size: int) -> str:
    """Write the function look_network.normalized; return the name of its result (n, 1, size, 3 * size).

    The means are GlobalAveragePool, because ONNX Runtime computes it faster than ReduceMean.
    """
    one_channel = graph.constant("input.shape", [0, 1, size, 3 * size])
    x = graph.node("Cast", [graph.node("Reshape", ["patches", one_channel], "input")], "input.colors", to=FLOAT)
    x = graph.node("Sub", [x, graph.node("GlobalAveragePool", [x], "input.mean")], "input.centered")
    variance = graph.node("GlobalAveragePool", [graph.node("Mul", [x, x], "input.squares")], "input.variance")
    deviation = graph.node("Sqrt", [variance], "input.deviation")
    scale = graph.node("Add", [deviation, graph.constant("input.floor", NOISE_FLOOR)], "input.scale")
    return graph.node("Div", [x, scale], "input.normalized")


def _write_layer(
    graph: OnnxGraph, operator: str, name: str, x: str, kernel: Floats, bias: Floats, **attributes: Any
) -> str:
    """Write a linear layer of the input x; return the name of its result."""
    constants = [_write_kernel(graph, name, kernel), graph.constant(f"{name}.bias", bias)]
    return graph.node(operator, [x, *constants], f"{name}.linear", **attributes)


def _write_kernel(graph: OnnxGraph, name: str, values: Floats) -> str:
    """Write a kernel (outputs, ...); return the name of it as float32. The file holds it as 8-bit integers if that
    loses nothing. ONNX Runtime multiplies them with their steps once, when it loads the file."""
    kernel = values.astype(np.float32)
    integers, steps = integers_of(kernel)
    if not np.array_equal(integers * steps, kernel):
        return graph.constant(f"{name}.kernel", kernel)
    whole = graph.node("Cast", [graph.constant(f"{name}.kernel", integers)], f"{name}.integers", to=FLOAT)
    return graph.node("Mul", [whole, graph.constant(f"{name}.steps", steps)], f"{name}.weights")
