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
from vm_embedded.network.model_file import LookFiles, ModelFile

from .look_checkpoint import LookCheckpoint
from .look_network import LookNetwork, LookShape


def look_of(model: ModelFile) -> LookCheckpoint:
    """The look network of a model file at objects, with its glances: the inverse of attach_look.attached.

    Its calibration is part of the last layer's weights, so its own is 1 and 0. Raises ModelError if the file has no
    look network, or one that vm-export did not write.
    """
    if model.manifest.look is None or model.look is None:
        raise ModelError(f"{model.path} has no close look; vm-export --look attaches one")
    return _look(model, model.manifest.look, model.look)


def upright_looks_of(model: ModelFile) -> list[LookCheckpoint]:
    """The same for the looks at uprights, in the manifest's order."""
    pairs = zip(model.manifest.upright_looks, model.upright_looks, strict=True)
    return [_look(model, contract, files) for contract, files in pairs]


def looks_for(manifest: Manifest, model: ModelFile) -> list[LookCheckpoint]:
    """The look networks of a model file that judge classes of another manifest, too. Raises ModelError without any."""
    names = {each.name for each in manifest.classes}
    found = [look_of(model)] if model.manifest.look is not None else []
    found = [each for each in (*found, *upright_looks_of(model)) if each.contract.object_class in names]
    if not found:
        judged = ", ".join(each.object_class for each in model.manifest.looks) or "nothing"
        raise ModelError(f"{model.path} has close looks at {judged}, but the classes are {', '.join(sorted(names))}")
    return found


def _look(model: ModelFile, contract: LookContract, files: LookFiles) -> LookCheckpoint:
    try:
        glance = None
        if contract.glance is not None:
            glance = _look(model, contract.glance, files[1:])
        return _checkpoint(contract, files[0], glance)
    except (KeyError, ValueError, RuntimeError) as error:
        raise ModelError(f"{model.path}: its close look has other layers than vm-export writes: {error}") from error


def _checkpoint(contract: LookContract, content: bytes, glance: LookCheckpoint | None) -> LookCheckpoint:
    constants = {each.name: numpy_helper.to_array(each) for each in onnx.load_from_string(content).graph.initializer}
    first, second, third = contract.channels
    shape = LookShape(contract.size, (first, second, third), len(constants["hidden.bias"]))
    network = LookNetwork(shape)
    network.load_state_dict(_state(constants, len(network.convolutions)))
    bare = replace(contract, self_test=None, glance=None if glance is None else glance.contract)
    return LookCheckpoint(network.eval(), bare, _examples(contract), glance)


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
