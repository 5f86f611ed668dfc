"""The look network of a model file as a torch network again, so that a training can go on from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from vm_embedded.arrays import Image, Singles
from vm_embedded.errors import ModelError
from vm_embedded.network.look_contract import LookContract
from vm_embedded.network.manifest import Manifest
from vm_embedded.network.model_file import ModelFile

from .look_checkpoint import LookCheckpoint
from .look_network import LookNetwork, LookShape


def looks_of(model: ModelFile) -> list[LookCheckpoint]:
    """The look networks of a model file, in the manifest's order: the inverse of attach_look.attached.

    Their calibration is part of the last layer's weights, so their own is 1 and 0. Raises ModelError for one that
    vm-export did not write.
    """
    try:
        return [_look(*each) for each in zip(model.manifest.looks, model.looks, strict=True)]
    except (KeyError, ValueError, RuntimeError) as error:
        raise ModelError(f"{model.path}: a close look has other layers than vm-export writes: {error}") from error


def looks_for(manifest: Manifest, model: ModelFile) -> list[LookCheckpoint]:
    """The look networks of a model file that judge classes of another manifest, too. Raises ModelError without any."""
    names = {each.name for each in manifest.classes}
    found = [each for each in looks_of(model) if each.contract.object_class in names]
    if not found:
        judged = ", ".join(each.object_class for each in model.manifest.looks) or "nothing"
        raise ModelError(f"{model.path} has close looks at {judged}, but the classes are {', '.join(sorted(names))}")
    return found


def _look(contract: LookContract, content: bytes) -> LookCheckpoint:
    constants = {each.name: numpy_helper.to_array(each) for each in onnx.load_from_string(content).graph.initializer}
    first, second, third = contract.channels
    network = LookNetwork(LookShape(contract.size, (first, second, third), len(constants["hidden.bias"])))
    network.load_state_dict(_state(constants, len(network.convolutions)))
    return LookCheckpoint(network.eval(), replace(contract, self_test=None), _examples(contract))


def _state(constants: Mapping[str, Singles], convolutions: int) -> dict[str, torch.Tensor]:
    """The weights by their names in torch, from those by their names in the graph of look_graph.look_model."""
    weights = {"calibration": np.array([1.0, 0.0], dtype=np.float32)}
    names = {f"layer{index}": f"convolutions.{index}" for index in range(convolutions)}
    for name, torch_name in {**names, "hidden": "hidden", "last": "answers"}.items():
        kernel = constants[f"{name}.kernel"] * constants.get(f"{name}.steps", 1.0)
        if name == "layer0":
            kernel = kernel.reshape(-1, 3, 3, 3).transpose(0, 3, 1, 2)
        weights |= {f"{torch_name}.weight": kernel, f"{torch_name}.bias": constants[f"{name}.bias"]}
    return {name: torch.from_numpy(np.array(value, dtype=np.float32)) for name, value in weights.items()}


def _examples(contract: LookContract) -> Image:
    """The first patches of the self-test; a gray one if there is none."""
    if contract.self_test is not None:
        return contract.self_test.patches.copy()  # its own array can't be written, which torch does not support
    return np.full((1, contract.size, contract.size, 3), 128, dtype=np.uint8)
