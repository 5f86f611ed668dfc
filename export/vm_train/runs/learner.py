"""A network that learns step by step, and the state between two steps.

A step depends only on the seed, its number and the state before it: the weights and the state of the optimizer. With
one computing thread on a CPU, a training that resumes from its last state therefore ends with the weights of one that
nobody interrupted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

import torch
from torch import distributed, nn

from vm_embedded.errors import InputError, one_line

from .optimizer import ScheduledOptimizer

N = TypeVar("N", bound=nn.Module)


class DivergedError(InputError):
    """A loss or an answer became NaN or infinite: to repeat the same steps would not help."""


class Learner(Generic[N]):
    """A network and its optimizer. done: number of steps so far, of `total`. device: as torch names it."""

    def __init__(self, network: N, optimizer: ScheduledOptimizer, total: int, device: str) -> None:
        self.network, self.total, self.done = network, total, 0
        self._optimizer, self._device = optimizer, device

    @property
    def rate(self) -> float:
        """The learning rate of the next step. Any schedule but a constant one replaces it after that step."""
        return self._optimizer.rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._optimizer.rate = rate

    def learn(self, mean: float, loss: torch.Tensor | None, clip: float = 0.0) -> None:
        """Change the weights by one step. Raises DivergedError if the loss is NaN or infinite.

        mean: the loss of all processes. loss: the part of this one, None without a part; the gradient is that of the
        sum of all parts. clip: largest norm of the gradient, 0 for any.
        """
        if not math.isfinite(mean):
            raise DivergedError(
                f"the loss of step {self.done + 1} is NaN or infinite: begin again with a lower training.rate"
            )
        self._optimizer.zero_grad()
        if loss is not None:
            loss.backward()  # type: ignore[no-untyped-call]
        if distributed.is_initialized():
            for each in self.network.parameters():
                each.grad = torch.zeros_like(each) if each.grad is None else each.grad
                distributed.all_reduce(each.grad)
        if clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), clip)
        self._optimizer.step()
        self.done += 1

    def state(self) -> dict[str, Any]:
        """The state to resume from: plain values and tensors."""
        return {
            "done": self.done,
            "network": self.network.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }

    def load(self, state: Mapping[str, Any]) -> None:
        """Resume from a state. Raises InputError if it belongs to another training."""
        try:
            self._load(state)
        except (RuntimeError, KeyError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f"the state belongs to another training: {one_line(error)}") from error

    def _load(self, state: Mapping[str, Any]) -> None:
        self.network.load_state_dict(state["network"])
        self._optimizer.load_state_dict(state["optimizer"])
        self.done = int(state["done"])
