"""The optimizer of a network's weights, with a learning rate that changes from step to step.

muon: the update of a weight matrix has the same size in every direction of its gradient (K. Jordan and others, 2024),
so all of the few channels of a small network learn. A kernel of a convolution is a matrix with a row for each output
channel. Biases use adamw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import nn

_MOMENTUM = 0.9  # of sgd


class ScheduledOptimizer:
    """The optimizers of a network's weights, and their schedule of `total` steps.

    kind, schedule: one of OPTIMIZERS and of SCHEDULES in configuration.py. rate: the highest learning rate. decay: of
    the weights.
    """

    def __init__(
        self, network: nn.Module, kind: str, rate: float, decay: float, total: int, schedule: str = "one_cycle"
    ) -> None:
        self._optimizers = _optimizers(network, kind, rate, decay)
        self._schedules: list[torch.optim.lr_scheduler.LRScheduler] = []
        if schedule == "one_cycle":
            self._schedules = [
                torch.optim.lr_scheduler.OneCycleLR(each, rate, total_steps=total) for each in self._optimizers
            ]

    @property
    def rate(self) -> float:
        """The learning rate of the next step."""
        return float(self._optimizers[0].param_groups[0]["lr"])

    @rate.setter
    def rate(self, rate: float) -> None:
        for optimizer in self._optimizers:
            for group in optimizer.param_groups:
                group["lr"] = rate

    def zero_grad(self) -> None:
        """Set all gradients to None."""
        for optimizer in self._optimizers:
            optimizer.zero_grad()

    def step(self) -> None:
        """Update the weights by their gradients, and the rate by its schedule."""
        for optimizer in self._optimizers:
            optimizer.step()
        for schedule in self._schedules:
            schedule.step()

    def state_dict(self) -> dict[str, Any]:
        """The state to resume from."""
        return {
            "optimizers": [each.state_dict() for each in self._optimizers],
            "schedules": [each.state_dict() for each in self._schedules],
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Resume from a state. Raises KeyError, ValueError or TypeError if it belongs to another kind of optimizer."""
        for optimizer, saved in zip(self._optimizers, state["optimizers"], strict=True):
            optimizer.load_state_dict(saved)
        for schedule, saved in zip(self._schedules, state["schedules"], strict=True):
            schedule.load_state_dict(saved)


class _Muon(torch.optim.Muon):
    """Muon for matrices and kernels: torch's own takes matrices only, so it gets views of the kernels."""

    def __init__(self, weights: Sequence[nn.Parameter], rate: float, decay: float) -> None:
        matrices = [each if each.ndim == 2 else nn.Parameter(each.detach().flatten(1)) for each in weights]
        self._kernels = [pair for pair in zip(weights, matrices, strict=True) if pair[0] is not pair[1]]
        super().__init__(matrices, lr=rate, weight_decay=decay)

    def zero_grad(self, set_to_none: bool = True) -> None:
        super().zero_grad(set_to_none)
        for kernel, _ in self._kernels:
            kernel.grad = None

    def step(self, closure: Any = None) -> Any:
        for kernel, matrix in self._kernels:
            if kernel.grad is not None:
                matrix.grad = kernel.grad.flatten(1)
        return super().step(closure)  # type: ignore[no-untyped-call]


def _optimizers(network: nn.Module, kind: str, rate: float, decay: float) -> list[torch.optim.Optimizer]:
    weights = list(network.parameters())
    if kind == "muon":
        biases = [each for each in weights if each.ndim < 2]
        muon = _Muon([each for each in weights if each.ndim >= 2], rate, decay)
        return [muon, torch.optim.AdamW(biases, lr=rate, weight_decay=decay)]
    if kind == "sgd":
        return [torch.optim.SGD(weights, lr=rate, momentum=_MOMENTUM, weight_decay=decay)]
    if kind == "adam":
        return [torch.optim.Adam(weights, lr=rate, weight_decay=decay)]
    return [torch.optim.AdamW(weights, lr=rate, weight_decay=decay)]
