"""The graph of a network on a canvas: ordinary convolutions, all in the block format of ONNX Runtime.

vm_embedded/network/canvas_layout.py prepares its inputs. Batch normalization is folded into the weights.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn

from vm_embedded.arrays import Singles
from vm_embedded.network.manifest import METADATA_KEY, PEAK_OUTPUTS, Manifest

from .canvas_network import CanvasNetwork, Separable
from .canvas_shape import CanvasShape
from .onnx_graph import BOOL, FLOAT, OnnxGraph

_LARGEST = 60.0
"""Largest logit: its exponential, times the number of classes, is finite. Beyond it, probabilities are 0 or 1."""


def canvas_model(network: CanvasNetwork, manifest: Manifest) -> bytes:
    """The bytes of an ONNX model.

    Inputs: points (1, 3, rows, columns) float32 and shown (1, 1, rows, columns) bool, as CanvasLayout gives them.
    Output: probabilities (1, C + 4 P, rows, columns) float32, which end with four numbers for each class with peaks.
    """
    writer = _Writer(OnnxGraph())
    graph = writer.graph
    shown = graph.node("Cast", ["shown"], "shown.numbers", to=FLOAT)
    canvas = graph.node("Concat", ["points", shown], "canvas", axis=1)
    stem = writer.convolve("stem", canvas, *_folded(network.stem, network.stem_norm))
    x = graph.node("Relu", [stem], "stem.out")
    finer = []
    for level, blocks in enumerate(network.blocks):
        for number, block in enumerate(blocks):
            x = writer.separable(f"down{level}.{number}", x, block)
        if level < len(network.halve):
            finer.append(x)
            x = writer.separable(f"halve{level}", x, network.halve[level])
    scales = graph.constant("twice", [1.0, 1.0, 2.0, 2.0])
    nearest = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
    for level in reversed(range(len(finer))):
        lift = network.lift[level]
        assert isinstance(lift, nn.Conv2d)
        lifted = writer.convolve(f"lift{level}", x, _array(lift.weight), _array(lift.bias))
        larger = graph.node("Resize", [lifted, "", scales], f"lift{level}.larger", **nearest)
        both = graph.node("Add", [finer[level], larger], f"lift{level}.both")
        x = writer.separable(f"up{level}", graph.node("Relu", [both], f"lift{level}.out"), network.up[level])
    head = writer.convolve("head", x, _array(network.head.weight), _array(network.head.bias))
    # A softmax in four steps: that of ONNX Runtime takes eight times as long over any axis but the last.
    limits = [graph.constant("lowest", -_LARGEST), graph.constant("highest", _LARGEST)]
    powers = graph.node("Exp", [graph.node("Clip", [head, *limits], "head.limited")], "powers")
    sums = graph.node("ReduceSum", [powers, graph.constant("classes", [1])], "sums")
    if network.seek is None or network.peaks is None:
        graph.node("Div", [powers, sums], "probabilities")
    else:
        shares = graph.node("Div", [powers, sums], "shares")
        sought = writer.separable("seek", x, network.seek)
        peaks = writer.convolve("peaks", sought, _array(network.peaks.weight), _array(network.peaks.bias))
        graph.node("Concat", [shares, peaks], "probabilities", axis=1)
    sizes: list[int | str] = ["rows", "columns"]
    return graph.model(
        {"points": (FLOAT, [1, 3, *sizes]), "shown": (BOOL, [1, 1, *sizes])},
        {"probabilities": (FLOAT, [1, network.shape.outputs, *sizes])},
        {METADATA_KEY: manifest.as_json()},
        "Visual Mesh network on strips of octaves, laid out as a picture. vm_embedded prepares it.",
    )


def read_canvas(constants: Mapping[str, Singles]) -> CanvasNetwork:
    """The network of a model that `canvas_model` wrote, from the model's constants by name; its answers are the same.

    Batch normalization has no effect until a training changes it. Raises KeyError, ValueError, RuntimeError or
    InputError for other models.
    """
    depth = sum(name.startswith("down0.") and name.endswith(".mix.kernel") for name in constants)
    peaks = len(constants["peaks.kernel"]) // PEAK_OUTPUTS if "peaks.kernel" in constants else 0
    shape = CanvasShape(depth, len(constants["stem.kernel"]), len(constants["head.kernel"]), peaks)
    network = CanvasNetwork(shape)

    def load(name: str, convolution: nn.Conv2d, norm: nn.BatchNorm2d | None = None) -> None:
        convolution.weight.data.copy_(torch.tensor(constants[f"{name}.kernel"]))
        target = convolution if norm is None else norm
        if target.bias is not None:
            target.bias.data.copy_(torch.tensor(constants[f"{name}.bias"]))
        if norm is not None:
            assert norm.running_var is not None
            norm.running_var.fill_(1.0 - norm.eps)

    def load_block(name: str, block: nn.Module) -> None:
        assert isinstance(block, Separable)
        load(f"{name}.depthwise", block.depthwise)
        load(f"{name}.mix", block.mix, block.norm)

    load("stem", network.stem, network.stem_norm)
    load("head", network.head)
    if network.seek is not None and network.peaks is not None:
        load_block("seek", network.seek)
        load("peaks", network.peaks)
    for level, blocks in enumerate(network.blocks):
        for number, block in enumerate(blocks):
            load_block(f"down{level}.{number}", block)
    for level, (halve, lift, up) in enumerate(zip(network.halve, network.lift, network.up, strict=True)):
        load_block(f"halve{level}", halve)
        load_block(f"up{level}", up)
        assert isinstance(lift, nn.Conv2d)
        load(f"lift{level}", lift)
    return network.eval()


class _Writer:
    """Writes convolutions into a graph."""

    def __init__(self, graph: OnnxGraph) -> None:
        self.graph = graph

    def separable(self, name: str, x: str, block: nn.Module) -> str:
        """A separable convolution of x; returns the name of the result."""
        assert isinstance(block, Separable)
        stride, channels = block.depthwise.stride[0], block.depthwise.groups
        each = self.convolve(f"{name}.depthwise", x, _array(block.depthwise.weight), None, stride, channels)
        mixed = self.convolve(f"{name}.mix", each, *_folded(block.mix, block.norm))
        added = self.graph.node("Add", [x, mixed], f"{name}.added") if block.adds else mixed
        return self.graph.node("Relu", [added], f"{name}.out")

    def convolve(
        self, name: str, x: str, kernel: Singles, bias: Singles | None = None, stride: int = 1, groups: int = 1
    ) -> str:
        """A convolution of x with a kernel (outputs, inputs, k, k); returns the name of the result."""
        side = kernel.shape[2]
        inputs = [x, self.graph.constant(f"{name}.kernel", kernel)]
        if bias is not None:
            inputs.append(self.graph.constant(f"{name}.bias", bias))
        return self.graph.node(
            "Conv",
            inputs,
            name,
            kernel_shape=[side, side],
            pads=[side // 2] * 4,
            strides=[stride, stride],
            group=groups,
        )


def _folded(convolution: nn.Conv2d, norm: nn.BatchNorm2d) -> tuple[Singles, Singles]:
    """Kernel and bias of a convolution with the batch normalization that follows it."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight.double() / torch.sqrt(norm.running_var.double() + norm.eps)
    kernel = convolution.weight.double() * scale[:, None, None, None]
    return _array(kernel), _array(norm.bias.double() - norm.running_mean.double() * scale)


def _array(values: torch.Tensor | None) -> Singles:
    assert values is not None
    found: Singles = values.detach().float().numpy()
    return found
