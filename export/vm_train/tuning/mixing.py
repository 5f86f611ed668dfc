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
    """How well a network knows labeled patches: for each of its classes its calibration on them, and its balanced loss
    with that; without patches the identity, and NaN."""

    calibrations: tuple[Calibration, ...]
    losses: tuple[float, ...]

    @classmethod
    def of(cls, network: LookNetwork, patches: PatchSet) -> Remembered:
        """The calibrations and the losses of a network."""
        found = [_remembered(network, patches.part(patches.kinds == kind)) for kind in range(network.shape.classes)]
        return cls(tuple(each for each, _ in found), tuple(loss for _, loss in found))


def _remembered(network: LookNetwork, patches: PatchSet) -> tuple[Calibration, float]:
    """The calibration on patches of one class, and the balanced loss with it."""
    shown = patches.labels == OBJECT
    if not 0 < shown.sum() < len(shown):
        return Calibration(1.0, 0.0), np.nan
    logits = logits_of(network, patches)[:, 0].astype(np.float64)
    calibration = Calibration.fit(logits, shown)
    return calibration, balanced_loss(calibration.scale * logits + calibration.offset, shown)


@dataclass(frozen=True, eq=False)
class Mixture:
    """A calibrated network whose weights are a mean. share: of the weights after the training. loss: balanced, of old
    patches; the mean of the classes."""

    network: LookNetwork
    share: float
    loss: float

    def loss_of(self, patches: PatchSet, kind: int) -> float:
        """The balanced loss of its probabilities of patches of a class; NaN if all or none show an object."""
        logits, (scale, offset) = logits_of(self.network, patches)[:, 0], self.network.calibration[kind].tolist()
        return balanced_loss(scale * logits.astype(np.float64) + offset, patches.labels == OBJECT)


class Mixer:
    """Mixes trained networks with the one before their training. old: patches that the network before knows."""

    def __init__(self, before: LookNetwork, old: PatchSet, forgetting: float) -> None:
        self._before, self._old, self._forgetting = before, old, forgetting
        self._remembered = Remembered.of(before, old)

    def mix(self, after: LookNetwork) -> Mixture:
        """The mixture with the largest share of the new weights that is within the limit: for each class, its loss of
        old patches is at most (1 + `forgetting`) times that of the network before. If none is, the one with the
        smallest share.

        The probability of an old patch keeps its meaning: it was calibrated on what is found in whole pictures.
        """
        before, limit = self._remembered, (1.0 + self._forgetting) * np.array(self._remembered.losses)
        for share in _SHARES:
            network = mixed(self._before, after, share)
            now = Remembered.of(network, self._old)
            if (np.isnan(limit) | (np.array(now.losses) <= limit)).all():
                break
        for row, new, old in zip(network.calibration, now.calibrations, before.calibrations, strict=True):
            row.copy_(torch.tensor([new.scale / old.scale, (new.offset - old.offset) / old.scale]))
        return Mixture(network, share, float(np.nanmean(now.losses)))


def mixed(before: LookNetwork, after: LookNetwork, share: float) -> LookNetwork:
    """A network with the mean of the weights of two; `share` is that of `after`."""
    network, old = copy.deepcopy(after), before.state_dict()
    network.load_state_dict({name: old[name].lerp(value, share) for name, value in after.state_dict().items()})
    return network.eval()
