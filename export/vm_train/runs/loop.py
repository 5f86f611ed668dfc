"""The loop of all trainings: a round has epochs; each epoch learns step by step, and then validates.

A stopped or killed training continues from its state, which is saved after each part of an epoch and twice a minute.
"""

from __future__ import annotations

import signal
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_export.torch_files import load_values, save_values

from .hardware import Hardware, sum_over_processes
from .learner import DivergedError, Learner
from .log import TrainingLog
from .run import Run

_SAVE_INTERVAL = 30.0  # [s] between states

_NONE = float("-inf")


@dataclass
class Progress:
    """How far a training is, besides its weights; state.pt keeps these entries.

    round: counted from 1; after the last one, the training is finished. validated: number of validated epochs of the
    network. best: the highest score of the round's validations; best_epoch: its epoch, counted from 1, 0 for none.
    best_ever: the highest score of all rounds.
    """

    round: int = 1
    validated: int = 0
    best: float = _NONE
    best_epoch: int = 0
    best_ever: float = _NONE

    def is_best(self, score: float) -> bool:
        """Whether a score is the best of the round; NaN, if nothing was measured, counts as better than all before."""
        return not score <= self.best

    def take(self, score: float) -> None:
        """The best score is that of the epoch that is being validated; its network is kept."""
        self.best, self.best_epoch, self.best_ever = score, self.validated + 1, max(self.best_ever, score)


@dataclass(frozen=True)
class Validation:
    """The result of an epoch. record: for the log. score: in words; more: further words."""

    record: dict[str, Any]
    score: str
    more: str = ""


class Training(ABC):
    """A kind of training. The loop calls `begin`, then `step` and `validate` in turn, and `finish`, for each round.

    rounds: their number. epochs: of a round, at most. steps: of an epoch. patience: the round ends after this many
    epochs without a better score; 0 for never. title: what to print before the number of an epoch. kept: plain values
    and tensors that belong to the state. held: what a round must release at its end.
    """

    rounds = 1
    epochs: int
    steps: int
    patience = 0
    title = ""
    run: Run
    learner: Learner[Any]

    def __init__(self) -> None:
        self.kept: dict[str, Any] = {}
        self.held = ExitStack()

    @abstractmethod
    def begin(self, progress: Progress, stopped: Callable[[], bool]) -> None:
        """Prepare a round: set `steps`, `title` and `learner`. The loop changes `progress` from now on.

        stopped: whether to stop, by raising KeyboardInterrupt; all processes must call it the same number of times.
        """

    @abstractmethod
    def step(self) -> dict[str, float]:
        """Learn from the next batch. Returns values for the log; one is the loss, another the learning rate."""

    @abstractmethod
    def validate(self) -> Validation:
        """Validate the network after an epoch."""

    @abstractmethod
    def finish(self) -> None:
        """End a round. It is called again if the training is killed before the next state."""


def train(training: Training, hardware: Hardware, stop_requested: Callable[[], bool]) -> bool:
    """Train until the end. Returns whether anything was left to do.

    Raises KeyboardInterrupt after the step in which `stop_requested` returned True in any process, and InputError.
    With one computing thread on a CPU, the final weights are the same however often the training was stopped or killed.
    """
    state = read_state(training.run.state_path)
    progress = Progress() if state is None else Progress(**state["progress"])
    if progress.round > training.rounds:
        return False

    def stopped() -> bool:
        """Whether any process was asked: they stop together."""
        return bool(sum_over_processes(torch.tensor(float(stop_requested()))) > 0.0)

    while progress.round <= training.rounds:
        try:
            training.begin(progress, stopped)
            _Round(training, hardware, progress, stopped).run(state)
            training.finish()
        finally:
            training.held.close()
        progress = Progress(progress.round + 1, best_ever=progress.best_ever)
        state = None
    _save(training, hardware, progress)
    return True


class _Round:
    """A round in work."""

    def __init__(self, training: Training, hardware: Hardware, progress: Progress, stopped: Callable[[], bool]) -> None:
        self._training, self._hardware, self._progress, self._stopped = training, hardware, progress, stopped
        self._saved = perf_counter()
        self._shown = ""  # the last validation, for the bar

    def run(self, state: dict[str, Any] | None) -> None:
        """Train from a state on; None: from the beginning of the round."""
        training, progress = self._training, self._progress
        if state is not None:
            training.learner.load(state)
            training.kept = dict(state["kept"])
        learner = training.learner
        self._bar = ProgressBar(learner.total, "vm-train", learner.done, "steps")
        log = TrainingLog(
            training.run.folder, progress.round, learner.done, progress.validated, self._hardware.is_leader
        )
        try:
            with log, self._saved_on_error():
                while progress.validated < training.epochs and not self._is_late():
                    self._validate(log, self._learn(log))
        finally:
            self._bar.clear()

    def _is_late(self) -> bool:
        """Whether the last epochs were not better for too long."""
        return 0 < self._training.patience <= self._progress.validated - self._progress.best_epoch

    def _learn(self, log: TrainingLog) -> str:
        """Train the rest of an epoch. Returns the mean loss and the learning rate in words."""
        training, learner = self._training, self._training.learner
        epoch, words = self._progress.validated + 1, []
        end, losses = epoch * training.steps, []
        while learner.done < end:
            values = training.step()
            log.write(learner.done, values)
            losses.append(values["loss"])
            words = [f"loss {np.mean(losses):.3f}", f"learning rate {values['rate']:.2g}"]
            self._bar.note = f"epoch {epoch}, {words[0]}{self._shown}"
            self._bar.advance()
            is_stopped = self._stopped()
            if is_stopped or learner.done == end or perf_counter() - self._saved > _SAVE_INTERVAL:
                self._save()
            if is_stopped:
                raise KeyboardInterrupt
        return "".join(f"{each}, " for each in words)  # none after a stop before a validation

    def _validate(self, log: TrainingLog, learned: str) -> None:
        """Validate, and print the result and the time left: a long training shows at once whether it learns."""
        training, progress = self._training, self._progress
        validation = training.validate()
        progress.validated += 1
        log.write(training.learner.done, {"epoch": progress.validated} | validation.record)
        self._bar.clear()
        self._shown = f", {validation.score}"
        if self._hardware.is_leader:
            epoch = f"{training.title}epoch {progress.validated} of {training.learner.total // training.steps}"
            best = " (the best so far)" if progress.best_epoch == progress.validated else ""
            result = f"{validation.score}{best}{validation.more}"
            print(f"{epoch}: {result}; {learned}{self._bar.left}", flush=True)
        self._save()

    def _save(self) -> None:
        _save(self._training, self._hardware, self._progress)
        self._saved = perf_counter()

    @contextmanager
    def _saved_on_error(self) -> Iterator[None]:
        """Save the state when a picture ends the training, and tell how to resume.

        A training that diverged would do so again, so it is not saved.
        """
        try:
            yield
        except DivergedError:
            raise
        except InputError as error:
            self._save()
            raise InputError(f"{error}; continue with vm-train resume {self._training.run.folder}") from error


def _save(training: Training, hardware: Hardware, progress: Progress) -> None:
    """Write the state to resume from. Raises InputError if it can't be written."""
    if hardware.is_leader:
        state = training.learner.state() | {"progress": asdict(progress), "kept": training.kept}
        save_values(training.run.state_path, state)


def read_state(path: Path) -> dict[str, Any] | None:
    """The state of a training, read without executing anything in it; None before the first. Raises InputError."""
    if not path.exists():
        return None
    try:
        state = load_values(path, "the state of a training")
    except InputError as error:
        raise InputError(f"can't resume: {error}; begin again in a new folder") from error
    if not isinstance(state, dict) or not {"progress", "kept"} <= state.keys():
        raise InputError(f"can't resume from {path}: it is not the state of a training; begin again in a new folder")
    return state


@contextmanager
def shown(total: int, stopped: Callable[[], bool]) -> Iterator[Callable[[int], None]]:
    """Yield a function that shows how many of `total` pictures are done. After a stop it raises KeyboardInterrupt."""
    bar = ProgressBar(total, "vm-train")

    def report(done: int) -> None:
        bar.show(done)
        if stopped():
            raise KeyboardInterrupt

    try:
        yield report
    finally:
        bar.clear()


@contextmanager
def stop_requests() -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether Ctrl-C or SIGTERM has asked for a stop after the current step.

    The same signal once more stops at once; the other one does not, because torchrun sends one after the other.
    """
    received: list[int] = []

    def handle(number: int, frame: object) -> None:
        if number in received:
            raise KeyboardInterrupt
        received.append(number)

    before = {each: signal.signal(each, handle) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(received)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
