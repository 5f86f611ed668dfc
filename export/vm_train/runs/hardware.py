"""The hardware of a training: its device, the processes that torchrun started, and the workers that read pictures."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypeVar

import torch
from torch import distributed

from vm_embedded.errors import InputError

Value = TypeVar("Value")

_PATIENCE = timedelta(days=1)
"""How long processes wait for the one that checks all pictures."""


@dataclass(frozen=True)
class Hardware:
    """One process's share. device: as torch names it. rank: of `size` processes. workers: that read its pictures."""

    device: str
    rank: int
    size: int
    workers: int

    @property
    def is_leader(self) -> bool:
        """Whether this process writes the files."""
        return self.rank == 0

    def broadcast(self, value: Value) -> Value:
        """Give every process the leader's value."""
        if self.size == 1:
            return value
        box = [value]
        distributed.broadcast_object_list(box, src=0)
        return box[0]

    def gather(self, value: Value) -> list[Value]:
        """Give every process the values of all, by rank."""
        if self.size == 1:
            return [value]
        box: list[Any] = [None] * self.size
        distributed.all_gather_object(box, value)
        return box


def sum_over_processes(value: torch.Tensor) -> torch.Tensor:
    """The sum of all processes' values, on the CPU; every process gets it."""
    if not distributed.is_initialized():
        return value
    total = value.to("cuda" if distributed.get_backend() == "nccl" else "cpu")  # nccl sends tensors of GPUs only
    distributed.all_reduce(total)
    return total.cpu()


def check_device(device: str) -> None:
    """Check the device of an option: auto, cpu or cuda. Raises InputError for cuda without a GPU."""
    if device == "cuda" and not torch.cuda.is_available():
        raise InputError("torch finds no GPU; use --device cpu")


@contextmanager
def set_up_hardware(device: str, workers: int | None, threads: int | None) -> Iterator[Hardware]:
    """Prepare torch for this process, and connect it with the others if torchrun started it.

    device: auto, cpu or cuda. workers: None for a number that suits the cores. threads: that compute; None for one.
    Raises InputError if the device is missing.
    """
    size, rank = int(os.environ.get("WORLD_SIZE", "1")), int(os.environ.get("RANK", "0"))
    local, locals_ = int(os.environ.get("LOCAL_RANK", "0")), int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    check_device(device)
    gpu = device != "cpu" and torch.cuda.is_available()
    if gpu and local >= torch.cuda.device_count():
        raise InputError(
            f"{locals_} processes for {torch.cuda.device_count()} GPUs: start at most one process for each GPU"
        )
    cores = max(len(os.sched_getaffinity(0)) // locals_, 1)
    if workers is None:
        workers = max(cores - 1, 1) if gpu else max(cores // 2, 1)
    # With more threads the last digits of sums differ from run to run, even in torch's deterministic mode.
    torch.set_num_threads(threads or 1)
    # Without it the order of sums may change, and a resumed training would end with other weights.
    torch.use_deterministic_algorithms(True, warn_only=True)
    # Deterministic mode also fills all new memory, which takes a quarter of a large network's step; switch that off.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    if gpu:
        torch.cuda.set_device(local)
    with process_group("nccl" if gpu else "gloo", timeout=_PATIENCE) if size > 1 else nullcontext():
        yield Hardware(f"cuda:{local}" if gpu else "cpu", rank, size, workers)


@contextmanager
def process_group(backend: str, **options: Any) -> Iterator[None]:
    """Meet the other processes of this training. options: those of torch.distributed.init_process_group."""
    # Optimizers import this module. If that happens while the group exists, the group's threads outlive it, and about
    # one process in twenty aborts at its end.
    importlib.import_module("torch._dynamo")
    distributed.init_process_group(backend, **options)
    try:
        yield
    finally:
        distributed.destroy_process_group()
