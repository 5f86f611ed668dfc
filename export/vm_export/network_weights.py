"""The mesh network of a model file as a torch network again, so that a training can go on from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError, ModelError
from vm_embedded.mesh.mesh import Groups
from vm_embedded.network.model_file import ModelFile

from .canvas_graph import read_canvas
from .checkpoint import Checkpoint
from .export import LARGEST_DIFFERENCE, largest_difference
from .mesh_networks import MeshNetwork
from .network import Network
from .network_shape import Layer, NetworkShape
from .runs_graph import ACTIVATION_PARTS, Activation, kernel_places

_OPERATORS = {"Selu": "selu", "Relu": "relu", "Elu": "elu", "Tanh": "tanh", "Softmax": "softmax", "Sigmoid": "sigmoid"}
"""Activations by the operators of the layout `plain`."""


@dataclass(frozen=True, eq=False)
class _Weights:
    """A layer and its weights as torch has them.

    kernel (outputs, inputs of the linear layer), bias (outputs,). depthwise (N + 1, inputs): of a separable one.
    """

    layer: Layer
    kernel: Floats
    bias: Floats
    depthwise: Floats | None = None


class _Graph:
    """The constants of a model file by name, and its nodes by the names of their outputs."""

    def __init__(self, content: bytes) -> None:
        graph = onnx.load_from_string(content).graph
        self.constants = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
        self.nodes = {each.output[0]: each for each in graph.node}

    @property
    def layers(self) -> list[str]:
        """Names of the layers, in order."""
        count = sum(name.startswith("layer") and name.endswith(".kernel") for name in self.constants)
        return [f"layer{index}" for index in range(count)]

    def weights(self, name: str) -> Floats:
        """A constant in double precision. Raises KeyError."""
        return np.asarray(self.constants[name], dtype=np.float64)


def network_of(model: ModelFile) -> Checkpoint:
    """The mesh network of a model file that vm-export wrote, in any layout; its answers are the same.

    In the layout `runs`, a separable convolution comes back as a full one. Raises ModelError for files of other
    programs.
    """
    manifest, foreign = model.manifest, f"{model.path}: its mesh network has other layers than vm-export writes"
    try:
        graph = _Graph(model.content)
        network: MeshNetwork
        if manifest.layout == "canvas":
            network = read_canvas(graph.constants)
        else:
            layers = _plain(graph) if manifest.layout == "plain" else _runs(graph, manifest.model.groups)
            network = _network(layers, manifest.neighbors)
        difference = largest_difference(model.content, network, manifest)
    except (KeyError, IndexError, ValueError, RuntimeError, InputError) as error:
        raise ModelError(f"{foreign}: {error}") from error
    if not difference <= LARGEST_DIFFERENCE:
        raise ModelError(f"{foreign}: its answers differ from those of the layers by {difference:.2g}")
    layout = "canvas" if manifest.layout == "canvas" else "plain"
    bare = replace(manifest, layout=layout, operations=0, self_test=None, look=None, upright_looks=())
    return Checkpoint(network, bare)


def _network(layers: list[_Weights], neighbors: int) -> Network:
    network = Network(NetworkShape(tuple(each.layer for each in layers), neighbors))
    state: dict[str, Floats] = {}
    for index, each in enumerate(layers):
        state |= {f"layers.{index}.linear.weight": each.kernel, f"layers.{index}.linear.bias": each.bias}
        if each.depthwise is not None:
            state[f"layers.{index}.depthwise"] = each.depthwise
    network.load_state_dict({name: torch.from_numpy(value.astype(np.float32)) for name, value in state.items()})
    return network.eval()


def _plain(graph: _Graph) -> list[_Weights]:
    """The layers of export.plain_model. Raises KeyError for other graphs."""
    found = []
    for name in graph.layers:
        kernel, bias = graph.weights(f"{name}.kernel").T, graph.weights(f"{name}.bias")
        node = graph.nodes["probabilities" if name == graph.layers[-1] else f"{name}.activation"]
        depthwise = None
        if f"{name}.around" in graph.constants:
            kind = "separable"
            depthwise = np.vstack([graph.weights(f"{name}.self"), graph.weights(f"{name}.around")])
        else:
            kind = "convolution" if f"{name}.gathered" in graph.nodes else "dense"
        found.append(_Weights(Layer(kind, len(bias), _OPERATORS[node.op_type]), kernel, bias, depthwise))
    return found


def _runs(graph: _Graph, groups: Groups) -> list[_Weights]:
    """The layers of runs_graph.runs_model, whose rewritings are undone. Raises KeyError for other graphs."""
    found, before = [], Activation()
    for name in graph.layers:
        kernel, bias = graph.weights(f"{name}.kernel"), graph.weights(f"{name}.bias")[:, 0]
        is_dense = f"{name}.window" not in graph.nodes
        kernel = (kernel[:, None] if is_dense else _unfolded(kernel, groups)) / before.scale
        is_last = name == graph.layers[-1]
        activation = _head(graph) if is_last else _activation(graph, name)
        parts = Activation() if is_last else ACTIVATION_PARTS[activation]
        bias = bias - parts.bias - before.constant * kernel.sum(axis=(1, 2))
        if is_last and _is_difference(graph):
            kernel, bias = np.concatenate([-kernel, kernel]) / 2.0, np.concatenate([-bias, bias]) / 2.0
        layer = Layer("dense" if is_dense else "convolution", len(bias), activation)
        found.append(_Weights(layer, kernel.reshape(len(kernel), -1), bias))
        before = parts
    return found


def _unfolded(weights: Floats, groups: Groups) -> Floats:
    """The inverse of how runs_graph lays out a kernel: (outputs, N + 1, inputs) from (outputs * G, 3 * inputs)."""
    taps = weights.reshape(-1, len(groups), weights.shape[1] // 3, 3)
    return np.stack([taps[:, group, :, 1 - shift] for _, group, shift in sorted(kernel_places(groups))], axis=1)


def _activation(graph: _Graph, name: str) -> str:
    """The activation of a layer before the last one."""
    node = graph.nodes[f"{name}.activation"]
    if node.op_type != "Add":
        return _OPERATORS[node.op_type]
    return str(graph.nodes[f"{name}.straight"].input[1]).removesuffix(".corner")


def _head(graph: _Graph) -> str:
    """The activation of the last layer."""
    return "softmax" if graph.nodes["probabilities"].op_type == "Div" or _is_difference(graph) else "sigmoid"


def _is_difference(graph: _Graph) -> bool:
    """Whether the last layer gives only the difference of two logits, for a softmax of two classes."""
    return bool(graph.nodes["probabilities"].input[0] == "head.both")
