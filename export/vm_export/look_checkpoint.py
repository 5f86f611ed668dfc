"""Checkpoints of look networks: weights, contract and examples in one .pt file of plain values and tensors."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from vm_embedded.arrays import Image
from vm_embedded.errors import InputError, ModelError, one_line
from vm_embedded.network.look_contract import LookContract
from vm_embedded.network.look_example import ANSWERS

from .look_network import LookNetwork, LookShape
from .torch_files import load_values, save_values

LOOK_FORMAT = "vm-embedded look 5"


@dataclass(frozen=True, eq=False)
class LookCheckpoint:
    """A trained look network, its contract, which has no self-test yet, and patches for that test.

    examples: uint8 (k, size, size, 3), RGB, from validation pictures; at least one. Raises ModelError if the parts do
    not fit each other.
    """

    network: LookNetwork
    contract: LookContract
    examples: Image

    def __post_init__(self) -> None:
        shape, contract = self.network.shape, self.contract
        if (contract.size, contract.channels) != (shape.size, shape.channels):
            raise ModelError(
                f"the look network has size {shape.size} and channels {list(shape.channels)}, but its contract says "
                f"{contract.size} and {list(contract.channels)}"
            )
        if len(contract.classes) != shape.classes:
            raise ModelError(
                f"the look network judges {shape.classes} classes, but its contract has {list(contract.names)}"
            )
        sides = (shape.size, shape.size, 3)
        if self.examples.dtype != np.uint8 or self.examples.shape[1:] != sides or not len(self.examples):
            raise ModelError(
                f"examples of a look network must be one or more uint8 patches of {sides}, not "
                f"{self.examples.dtype} {self.examples.shape}"
            )

    def part(self, names: Collection[str]) -> LookCheckpoint:
        """The same network for those of its classes that have these names. Raises ModelError if there is none."""
        kept = [number for number, name in enumerate(self.contract.names) if name in names]
        if not kept:
            raise ModelError(
                f"the close look judges {', '.join(self.contract.names)}, but the network has peaks for "
                f"{', '.join(sorted(names)) or 'no class'}"
            )
        network = LookNetwork(replace(self.network.shape, classes=len(kept)))
        answers = (torch.tensor(kept)[:, None] * len(ANSWERS) + torch.arange(len(ANSWERS))).flatten()
        state = self.network.state_dict()
        state |= {name: state[name][answers] for name in ("answers.weight", "answers.bias")}
        network.load_state_dict(state | {"calibration": state["calibration"][kept]})
        contract = replace(self.contract, classes=tuple(self.contract.classes[number] for number in kept))
        return replace(self, network=network.eval(), contract=contract)

    def weighted(self, weight: float) -> LookCheckpoint:
        """The same network, beside whose answers the scores of peaks count with this weight for each class."""
        classes = tuple(replace(each, mesh_weight=weight) for each in self.contract.classes)
        return replace(self, contract=replace(self.contract, classes=classes))

    def recalibrated(
        self, name: str, scale: float, offset: float, source: str, weight: float | None = None
    ) -> LookCheckpoint:
        """The same network, whose probability of a class, with the peak's score that counts in it, has the logit
        `scale * logit + offset`.

        weight: of the peak's score in that logit; None: the one that it has. source: the answers that the scale and the
        offset fit.
        """
        network, number = copy.deepcopy(self.network), self.contract.names.index(name)
        first, before = network.calibration[number].tolist()
        network.calibration[number] = torch.tensor([scale * first, scale * before + offset])
        classes = list(self.contract.classes)
        old = classes[number].mesh_weight if weight is None else weight
        classes[number] = replace(classes[number], mesh_weight=scale * old, calibrated_on=source)
        return replace(self, network=network, contract=replace(self.contract, classes=tuple(classes)))

    def save(self, path: str | Path) -> None:
        """Write the checkpoint. Raises InputError."""
        content = {
            "format": LOOK_FORMAT,
            "network": self.network.shape.as_dict(),
            "contract": replace(self.contract, self_test=None).as_dict(),
            "examples": torch.from_numpy(np.ascontiguousarray(self.examples)),
            "state": self.network.state_dict(),
        }
        save_values(path, content)

    @classmethod
    def load(cls, path: str | Path) -> LookCheckpoint:
        """Read a checkpoint without executing anything in it. Raises InputError or ModelError."""
        content = load_values(path, "a checkpoint of a look network")
        if not isinstance(content, dict) or content.get("format") != LOOK_FORMAT:
            found = content.get("format") if isinstance(content, dict) else None
            expected = f"its format must be {LOOK_FORMAT!r}, not {found!r}"
            raise InputError(f"{path} is not a close look, which vm-train look writes: {expected}")
        try:
            network = LookNetwork(LookShape.from_dict(content["network"]))
            network.load_state_dict(content["state"])
            return cls(network.eval(), LookContract.from_dict(content["contract"]), content["examples"].numpy())
        except (RuntimeError, KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{path}: its parts do not fit each other: {one_line(error)}") from error
        except (InputError, ModelError) as error:
            raise type(error)(f"{path}: {error}") from error
