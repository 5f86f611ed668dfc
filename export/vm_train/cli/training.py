"""Runs a training of any kind from the command line: begin it or resume it, and train until it ends or is stopped."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from vm_embedded.cli.program import EXIT_OK
from vm_embedded.errors import InputError, VisualMeshError
from vm_workstation.worker_process import check_shared_memory

if TYPE_CHECKING:
    from ..runs.hardware import Hardware
    from ..runs.loop import Training

T = TypeVar("T", bound="Training")


def run_training(
    options: argparse.Namespace,
    folder: Path,
    load: Callable[[Hardware], T],
    report: Callable[[T], None],
    begin: Callable[[Hardware], None] | None = None,
    alone: bool = False,
) -> int:
    """Train and return the exit status. options: those of `add_hardware`.

    begin: writes the folder of a new training; None resumes the one that is there. load: reads it. report: prints its
    result. alone: it runs in one process; without --workers, it has as many as cores. Raises VisualMeshError, and
    KeyboardInterrupt after the step in which Ctrl-C or SIGTERM asked for a stop.
    """
    import torch

    from ..runs.hardware import set_up_hardware
    from ..runs.loop import stop_requests, train
    from ..runs.run import locked

    workers = options.workers or len(os.sched_getaffinity(0)) if alone else options.workers
    if workers is None or workers > (1 if alone else 0):  # these processes share memory
        check_shared_memory()
    with set_up_hardware(options.device, workers, options.threads) as hardware, ExitStack() as held:
        if alone and hardware.size > 1:
            raise InputError("only the training of a mesh network runs in several processes: start it without torchrun")

        def prepare() -> None:
            held.enter_context(locked(folder))
            if begin is not None:
                begin(hardware)

        # The leader prepares everything; the other processes wait for its error message, or None.
        error = hardware.broadcast(_message_of_error(prepare) if hardware.is_leader else None)
        if error is not None:
            raise InputError(error)
        training = load(hardware)
        torch.set_num_threads(options.threads or training.run.threads)
        with stop_requests() as stop_requested:
            is_new = train(training, hardware, stop_requested)
        if hardware.is_leader:
            if not is_new:
                print(f"{training.run.result_path}: the training was finished already")
            report(training)
    return EXIT_OK


def _message_of_error(work: Callable[[], object]) -> str | None:
    """Message of the VisualMeshError that work raises, or None."""
    try:
        work()
    except VisualMeshError as error:
        return str(error)
    return None
