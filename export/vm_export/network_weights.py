"""The mesh network of a model file as a torch network again, so that a training can go on from it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from vm_embedded.arrays import Floats
from vm_embedded.errors import InputError, ModelError
from vm_embedded.network.model_file import ModelFile

from .canvas_graph import read_canvas
from .checkpoint import Checkpoint
from .export import LARGEST_DIFFERENCE, largest_difference
from .mesh_networks import MeshNetwork
from .network import Network
from .network_shape import Layer, NetworkShape

_OPERATORS = {"Selu": "selu", "Relu": "relu", "Elu": "elu", "Tanh": "tanh", "Softmax": "softmax", "Sigmoid": "sigmoid"}
"""Activations by their operators."""


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
    """The mesh network of a model file that vm-export wrote; its answers are the same. Raises ModelError for files of
    other programs."""
    manifest, foreign = model.manifest, f"{model.path}: its mesh network has other layers than vm-export writes"
    try:
        graph = _Graph(model.content)
        on_graph = not manifest.on_canvas
        network: MeshNetwork = _network(_plain(graph), manifest.neighbors) if on_graph else read_canvas(graph.constants)
        difference = largest_difference(model.content, network, manifest)
    except (KeyError, IndexError, ValueError, RuntimeError, InputError) as error:
        raise ModelError(f"{foreign}: {error}") from error
    if not difference <= LARGEST_DIFFERENCE:
        raise ModelError(f"{foreign}: its answers differ from those of the layers by {difference:.2g}")
    return Checkpoint(network, replace(manifest, operations=0, self_test=None, look=None))


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
