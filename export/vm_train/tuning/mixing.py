"""Mixes the weights of a network before and after a training, so that it does not forget what it knew.

The mean of both learns most of the new, and keeps most of the old (M. Wortsman and others, "Robust fine-tuning of
zero-shot models", 2022).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np

from vm_export.look_network import LookNetwork

from ..look.labels import OBJECT
from ..look.patch_set import PatchSet
from ..look.scores import Calibration, balanced_loss, logits_of

_SHARES = tuple(tenth / 10.0 for tenth in range(10, 0, -1))
"""Shares of the weights after the training to try, the largest first."""


@dataclass(frozen=True)
class Remembered:
    """How well a network knows labeled patches: its calibration on them, and its mean loss with that calibration."""

    calibration: Calibration
    loss: float

    @classmethod
    def of(cls, network: LookNetwork, patches: PatchSet) -> Remembered:
        """The calibration and the loss of a network."""
        logits, shown = logits_of(network.eval(), patches.patches)[:, 0].astype(np.float64), patches.labels == OBJECT
        calibration = Calibration.fit(logits, shown)
        return cls(calibration, balanced_loss(calibration.scale * logits + calibration.offset, shown))


@dataclass(frozen=True, eq=False)
class Mixture:
    """A network whose weights are a mean. share: of the weights after the training. remembered: of old patches."""

    network: LookNetwork
    share: float
    remembered: Remembered


def mixed(before: LookNetwork, after: LookNetwork, share: float) -> LookNetwork:
    """A network with the mean of the weights of two; `share` is that of `after`."""
    network, old = copy.deepcopy(after), before.state_dict()
    network.load_state_dict({name: old[name].lerp(value, share) for name, value in after.state_dict().items()})
    return network


def most_of_the_new(before: LookNetwork, after: LookNetwork, patches: PatchSet, forgetting: float) -> Mixture:
    """The mixture with most of the new weights whose loss on old patches is at most (1 + `forgetting`) times that of
    the network before; if there is none, the one with least of the new weights."""
    limit = (1.0 + forgetting) * Remembered.of(before, patches).loss
    for share in _SHARES:
        network = mixed(before, after, share)
        mixture = Mixture(network, share, Remembered.of(network, patches))
        if mixture.remembered.loss <= limit:
            break
    return mixture
