"""Checkpoints of look networks: weights, contract, examples and glance in one .pt file of plain values and tensors."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from vm_embedded.arrays import Image
from vm_embedded.errors import InputError, ModelError, one_line
from vm_embedded.network.look_contract import LookContract

from .look_network import LookNetwork, LookShape
from .torch_files import load_values, save_values

LOOK_FORMAT = "vm-embedded look 3"


@dataclass(frozen=True, eq=False)
class LookCheckpoint:
    """A trained look network, its contract, which has no self-test yet, and patches for that test.

    examples: uint8 (k, size, size, 3), RGB, from validation pictures; at least one. glance: the checkpoint of the
    network that goes before it, whose contract is also in `contract`. Raises ModelError if the parts do not fit each
    other.
    """

    network: LookNetwork
    contract: LookContract
    examples: Image
    glance: LookCheckpoint | None = None

    def __post_init__(self) -> None:
        shape, contract = self.network.shape, self.contract
        if (contract.size, contract.channels) != (shape.size, shape.channels):
            raise ModelError(
                f"the look network has size {shape.size} and channels {list(shape.channels)}, but its contract says "
                f"{contract.size} and {list(contract.channels)}"
            )
        sides = (shape.size, shape.size, 3)
        if self.examples.dtype != np.uint8 or self.examples.shape[1:] != sides or not len(self.examples):
            raise ModelError(
                f"examples of a look network must be one or more uint8 patches of {sides}, not "
                f"{self.examples.dtype} {self.examples.shape}"
            )
        if contract.glance != (self.glance and self.glance.contract):
            raise ModelError("the glance of the look network is not the one in its contract")

    def for_points_above(self, probability: float) -> LookCheckpoint:
        """The same networks for a mesh network whose points count for a proposal above another probability.

        Raises ModelError if it is out of range.
        """
        glance = None if self.glance is None else self.glance.for_points_above(probability)
        contract = replace(self.contract, above=probability, glance=None if glance is None else glance.contract)
        return LookCheckpoint(self.network, contract, self.examples, glance)

    def recalibrated(self, scale: float, offset: float, source: str) -> LookCheckpoint:
        """The same networks, whose probability, with all that counts in it, has the logit `scale * logit + offset`.

        The glance changes only if this is a wide look with one pass: then its logit is a part of a mean with that of
        the glance. source: the answers that the scale and the offset fit, for the provenance.
        """
        glance = self.glance
        if glance is not None and self.contract.is_wide and self.contract.passes == 1:
            glance = glance.recalibrated(scale, offset, source)
        network, (first, before) = copy.deepcopy(self.network), self.network.calibration.tolist()
        network.calibration.copy_(torch.tensor([scale * first, scale * before + offset]))
        provenance = {**self.contract.provenance, "calibrated_on": source}
        weight = scale * self.contract.mesh_weight
        contract = replace(self.contract, provenance=provenance, mesh_weight=weight)
        if glance is not None:
            contract = replace(contract, glance=glance.contract)
        return LookCheckpoint(network, contract, self.examples, glance)

    def save(self, path: str | Path) -> None:
        """Write the checkpoint. Raises InputError."""
        save_values(path, {"format": LOOK_FORMAT} | self._as_dict())

    def _as_dict(self) -> dict[str, Any]:
        """Plain values and tensors. The contract of the glance is in the glance's own part."""
        return {
            "network": self.network.shape.as_dict(),
            "contract": replace(self.contract, glance=None, self_test=None).as_dict(),
            "examples": torch.from_numpy(np.ascontiguousarray(self.examples)),
            "state": self.network.state_dict(),
            "glance": None if self.glance is None else self.glance._as_dict(),
        }

    @classmethod
    def load(cls, path: str | Path) -> LookCheckpoint:
        """Read a checkpoint without executing anything in it. Raises InputError or ModelError."""
        content = load_values(path, "a checkpoint of a look network")
        if not isinstance(content, dict) or content.get("format") != LOOK_FORMAT:
            found = content.get("format") if isinstance(content, dict) else None
            expected = f"its format must be {LOOK_FORMAT!r}, not {found!r}"
            raise InputError(f"{path} is not a close look, which vm-train look writes: {expected}")
        try:
            return cls._from_dict(content)
        except (RuntimeError, KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{path}: its parts do not fit each other: {one_line(error)}") from error
        except (InputError, ModelError) as error:
            raise type(error)(f"{path}: {error}") from error

    @classmethod
    def _from_dict(cls, content: Mapping[str, Any]) -> LookCheckpoint:
        """Inverse of `_as_dict`."""
        network = LookNetwork(LookShape.from_dict(content["network"]))
        network.load_state_dict(content["state"])
        glance = None if content["glance"] is None else cls._from_dict(content["glance"])
        contract = replace(LookContract.from_dict(content["contract"]), glance=glance.contract if glance else None)
        return cls(network.eval(), contract, content["examples"].numpy(), glance)
