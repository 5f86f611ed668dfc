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
from vm_embedded.network.model_file import ModelFile

from .look_checkpoint import LookCheckpoint
from .look_network import LookNetwork, LookShape


def look_of(model: ModelFile) -> LookCheckpoint | None:
    """The look network of a model file: the inverse of attach_look.attached. None without one.

    Its calibration is part of the last layer's weights, so its own is 1 and 0. Raises ModelError for one that vm-export
    did not write.
    """
    contract = model.manifest.look
    if contract is None:
        return None
    try:
        constants = {
            each.name: numpy_helper.to_array(each) for each in onnx.load_from_string(model.look).graph.initializer
        }
        first, second, third = contract.channels
        hidden = len(constants["hidden.bias"])
        network = LookNetwork(LookShape(contract.size, (first, second, third), hidden, len(contract.classes)))
        network.load_state_dict({"calibration": network.calibration, **_state(constants, len(network.convolutions))})
        return LookCheckpoint(network.eval(), replace(contract, self_test=None), _examples(contract))
    except (KeyError, ValueError, RuntimeError) as error:
        raise ModelError(f"{model.path}: its close look has other layers than vm-export writes: {error}") from error


def _state(constants: Mapping[str, Singles], convolutions: int) -> dict[str, torch.Tensor]:
    """The weights by their names in torch, without the calibration.

    constants: by their names in the graph of look_graph.look_model.
    """
    weights: dict[str, Singles] = {}
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
