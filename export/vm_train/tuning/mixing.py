"""Mixes the weights of a network before and after a training, so that it does not forget what it knew.

The mean of both learns most of the new, and keeps most of the old (M. Wortsman and others, "Robust fine-tuning of
zero-shot models", 2022).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import torch

from vm_export.look_network import LookNetwork

from ..look.labels import OBJECT
from ..look.patch_set import PatchSet
from ..look.scores import balanced_loss, logits_of
from ..scores.calibration import Calibration

_SHARES = tuple(tenth / 10.0 for tenth in range(10, 0, -1))
"""Shares of the weights after the training to try, the largest first."""


@dataclass(frozen=True)
class Remembered:
    """How well a network knows labeled patches: its calibration on them, and its balanced loss with that."""

    calibration: Calibration
    loss: float

    @classmethod
    def of(cls, network: LookNetwork, patches: PatchSet) -> Remembered:
        """The calibration and the loss of a network."""
        logits, shown = logits_of(network, patches.patches)[:, 0].astype(np.float64), patches.labels == OBJECT
        calibration = Calibration.fit(logits, shown)
        return cls(calibration, balanced_loss(calibration.scale * logits + calibration.offset, shown))


@dataclass(frozen=True, eq=False)
class Mixture:
    """A calibrated network whose weights are a mean. share: of the weights after the training. loss: balanced, of old
    patches."""

    network: LookNetwork
    share: float
    loss: float

    def loss_of(self, patches: PatchSet) -> float:
        """The balanced loss of its probabilities of patches; NaN if one kind is missing."""
        logits, (scale, offset) = logits_of(self.network, patches.patches)[:, 0], self.network.calibration.tolist()
        return balanced_loss(scale * logits.astype(np.float64) + offset, patches.labels == OBJECT)


class Mixer:
    """Mixes trained networks with the one before their training. old: patches that the network before knows."""

    def __init__(self, before: LookNetwork, old: PatchSet, forgetting: float) -> None:
        self._before, self._old, self._forgetting = before, old, forgetting
        self._remembered = Remembered.of(before, old)

    def mix(self, after: LookNetwork) -> Mixture:
        """The mixture with the largest share of the new weights that is within the limit: its loss of old patches is at
        most (1 + `forgetting`) times that of the network before. If none is, the one with the smallest share.

        The probability of an old patch keeps its meaning: it was calibrated on what is found in whole pictures.
        """
        before = self._remembered
        for share in _SHARES:
            network = mixed(self._before, after, share)
            now = Remembered.of(network, self._old)
            if now.loss <= (1.0 + self._forgetting) * before.loss:
                break
        scale = now.calibration.scale / before.calibration.scale
        offset = (now.calibration.offset - before.calibration.offset) / before.calibration.scale
        network.calibration.copy_(torch.tensor([scale, offset]))
        return Mixture(network, share, now.loss)


def mixed(before: LookNetwork, after: LookNetwork, share: float) -> LookNetwork:
    """A network with the mean of the weights of two; `share` is that of `after`."""
    network, old = copy.deepcopy(after), before.state_dict()
    network.load_state_dict({name: old[name].lerp(value, share) for name, value in after.state_dict().items()})
    return network.eval()
