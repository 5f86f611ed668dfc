"""The rounds of a training.

Each round trains a new network, from random weights or from those of a trained network (start.py). After each epoch the
network is validated, and the round keeps its best epoch in a checkpoint. A stopped training continues from its state,
which is saved twice a minute.

Validation AP is the average precision of the mesh points of the classes that are objects, or of all classes if none is.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from itertools import tee
from pathlib import Path
from time import perf_counter

import numpy as np
import torch

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_export.checkpoint import Checkpoint
from vm_export.mesh_networks import new_network

from ..graphs.labeled_graph import LabeledGraph
from ..graphs.loading import load_batches
from ..graphs.schedule import Batch, steps_an_epoch
from ..scores.point_scores import PointScores
from .hardware import Hardware
from .log import TrainingLog
from .run_folder import TrainingRun
from .trainer import DivergedError, Trainer, read_state, sum_over_processes

_SAVE_INTERVAL = 30.0  # [s] between states


@dataclass
class TrainingProgress:
    """How far a training is, besides its weights; state.pt keeps these entries.

    round: counted from 1. finished: whether the round is. validated: number of its validated epochs. best: validation
    AP of its best network. best_epoch: epoch of that network, counted from 1. best_ever: the best of all rounds.
    """

    round: int = 1
    finished: bool = False
    validated: int = 0
    best: float = -1.0
    best_epoch: int = 0
    best_ever: float = -1.0


@dataclass(frozen=True)
class TrainingOutcome:
    """Result of a call of `train`.

    finished: False if it was stopped. pictures, seconds: number of pictures used in all processes, and time
    taken, in this call.
    """

    finished: bool
    progress: TrainingProgress
    pictures: int
    seconds: float


def train(run: TrainingRun, hardware: Hardware, stop_requested: Callable[[], bool]) -> TrainingOutcome:
    """Train until the end, or until `stop_requested` returns True. Raises InputError.

    With one computing thread on a CPU, the final weights are the same however often the training was stopped or killed.
    """
    began = perf_counter()
    progress = TrainingProgress()
    if run.state_path.exists():
        progress = TrainingProgress(**read_state(run.state_path)["more"])
    pictures = 0
    while True:
        if progress.finished:
            if progress.round == run.configuration.training.trainings:
                return TrainingOutcome(True, progress, pictures, perf_counter() - began)
            progress = TrainingProgress(round=progress.round + 1, best_ever=progress.best_ever)
        pictures += _train_round(run, hardware, progress, stop_requested)
        if not progress.finished:
            return TrainingOutcome(False, progress, pictures, perf_counter() - began)


def _train_round(
    run: TrainingRun, hardware: Hardware, progress: TrainingProgress, stop_requested: Callable[[], bool]
) -> int:
    """Train the rest of a round, or until a stop. Updates progress; returns the number of pictures used."""
    trainer = _round_trainer(run, hardware, progress)
    # Two iterators: the workers take batches `ahead` of time, and the loop takes the same `batches` in step with their
    # graphs. A list of all would not fit into memory for large sets.
    batches, ahead = tee(_remaining_batches(run, progress.round, trainer.done, progress.validated))
    own_ahead = (each.part(hardware.rank, hardware.size) for each in ahead)
    pictures = 0
    with TrainingLog(run.folder, progress.round, trainer.done, progress.validated, hardware.is_leader) as log:
        current = _Round(run, hardware, progress, trainer, log)
        with (
            _saved_on_error(run.folder, current.save),
            closing(load_batches(run.scheduled_graphs(), own_ahead, hardware.workers)) as loader,
        ):
            for whole, graphs in zip(batches, loader, strict=True):
                batch = whole.part(hardware.rank, hardware.size)
                pictures += len(whole.items)
                current.process(batch, graphs, pictures)
                if current.is_out_of_patience(batch):
                    break
                current.save_if_due(batch)
                # Stop together: any process may have been asked.
                if sum_over_processes(torch.tensor(float(stop_requested()))) > 0.0:
                    current.stop(batch)
                    return pictures
    current.finish()
    return pictures


class _Round:
    """A round in progress: its batches are learned or scored, and its state and best network saved."""

    def __init__(
        self,
        run: TrainingRun,
        hardware: Hardware,
        progress: TrainingProgress,
        trainer: Trainer,
        log: TrainingLog,
    ) -> None:
        self._run, self._hardware, self._progress, self._trainer, self._log = run, hardware, progress, trainer, log
        self._classes = tuple(run.configuration.classes.colors)
        self._scores = PointScores(self._classes)
        self._bar = ProgressBar(trainer.total, "vm-train", trainer.done)
        self._saved = perf_counter()
        self._losses: list[float] = []  # of the steps of this epoch
        self._rate = math.nan  # of the last step
        self._shown = ""  # the last validation, for the bar

    def process(self, batch: Batch, graphs: Sequence[LabeledGraph], pictures: int) -> None:
        """Learn from this process's part of a batch, or validate with it. pictures: number of those used so far."""
        if batch.validates:
            for each in graphs:
                self._scores.add(self._trainer.probabilities(each), each.labels, each.distances)
            if batch.last:
                self._end_validation(pictures)
        else:
            step = self._trainer.step(batch.items, graphs)
            self._log.write(step.number, {"loss": step.loss, "points": step.points, "rate": step.rate})
            self._losses.append(step.loss)
            self._rate = step.rate
            self._bar.note = f"epoch {batch.epoch + 1}, loss {np.mean(self._losses):.3f}{self._shown}"
            self._bar.advance()

    def is_out_of_patience(self, batch: Batch) -> bool:
        """Whether a validation has just ended, and the last `patience` of them found no better network."""
        patience = self._run.configuration.training.patience
        waited = self._progress.validated - self._progress.best_epoch
        return batch.validates and batch.last and 0 < patience <= waited

    def save(self) -> None:
        """Write the state to resume from."""
        if self._hardware.is_leader:
            self._trainer.save(self._run.state_path, asdict(self._progress))
        self._saved = perf_counter()

    def save_if_due(self, batch: Batch) -> None:
        """Save after an epoch's training and after its validation, and between steps twice a minute."""
        if batch.last or (not batch.validates and perf_counter() - self._saved > _SAVE_INTERVAL):
            self.save()

    def stop(self, batch: Batch) -> None:
        """Save before a stop. A stopped validation starts again; the state before it is saved already."""
        if not batch.validates:
            self.save()
        self._bar.clear()

    def finish(self) -> None:
        """Mark the round as finished, in all processes."""
        self._bar.clear()
        self._progress.finished = True
        self.save()
        self._hardware.broadcast(None)  # wait until the leader has written the network that the next round reads

    def _end_validation(self, pictures: int) -> None:
        """Validate the network over all processes, and keep it if it is the best so far."""
        first, *others = self._hardware.gather(self._scores)
        scores = sum(others, start=first)
        self._scores = PointScores(self._classes)
        precisions = {name: scores.ranking(name).precision_recall.average_precision for name in scores.classes}
        known = {name: value for name, value in precisions.items() if not math.isnan(value)}
        objects = [name for name, kind in self._run.configuration.classes.kinds.items() if kind == "object"]
        precision = _mean_precision(known, objects)
        self._progress.validated += 1
        self._warn_if_unseen(known, objects)
        record = {
            "epoch": self._progress.validated,
            "validation_average_precision": precision,
            "average_precision": known,
        }
        self._log.write(self._trainer.done, record)
        is_best = precision > self._progress.best
        self._report(precision, is_best, pictures)
        if is_best:
            self._keep(precision)

    def _report(self, precision: float, is_best: bool, pictures: int) -> None:
        """Print the result of an epoch, speed and time left: a long training shows at once whether it learns."""
        self._bar.clear()
        self._shown = f", validation AP {precision:.3f}"
        recipe, best = self._run.configuration.training, " (the best so far)" if is_best else ""
        words = [f"validation AP {precision:.3f}{best}"]
        if self._losses:  # there are none after a stop before a validation
            words = [f"loss {np.mean(self._losses):.3f}", *words, f"learning rate {self._rate:.2g}"]
        words += [f"{pictures / max(self._bar.elapsed, 1e-9):.0f} pictures/s", self._bar.left]
        self._losses.clear()
        if self._hardware.is_leader:
            prefix = f"round {self._progress.round} of {recipe.trainings}, " if recipe.trainings > 1 else ""
            print(f"{prefix}epoch {self._progress.validated} of {recipe.epochs}: {', '.join(words)}", flush=True)

    def _warn_if_unseen(self, known: dict[str, float], objects: Sequence[str]) -> None:
        """After the first validation, warn if its pictures show none of the classes that are objects."""
        unseen = bool(objects) and not known.keys() & set(objects)
        if unseen and self._progress.validated == 1 and self._hardware.is_leader:
            print(
                f"vm-train: the validation pictures show no {' or '.join(objects)}: the validation AP is the mean "
                "of all classes",
                file=sys.stderr,
            )

    def _keep(self, precision: float) -> None:
        """Write the round's best network, and the best of all rounds if it is that, too."""
        progress, run = self._progress, self._run
        progress.best, progress.best_epoch = precision, progress.validated
        is_best_ever = precision > progress.best_ever
        progress.best_ever = max(progress.best_ever, precision)
        if not self._hardware.is_leader:
            return
        provenance = run.provenance() | {
            "round": str(progress.round),
            "epoch": str(progress.validated),
            "validation_average_precision": f"{precision:.4f}",
            "torch": torch.__version__,
        }
        manifest = replace(run.configuration.manifest, provenance=provenance)
        checkpoint = Checkpoint(self._trainer.network, manifest, run.configuration.grid)
        checkpoint.save(run.round_path(progress.round))
        if is_best_ever:
            checkpoint.save(run.model_path)


def _round_trainer(run: TrainingRun, hardware: Hardware, progress: TrainingProgress) -> Trainer:
    """The trainer of a round, resumed from the saved state if that belongs to this round."""
    recipe = run.configuration.training
    torch.manual_seed(int(np.random.default_rng([recipe.seed, progress.round]).integers(2**31)))
    network = new_network(run.configuration.network_shape)
    if run.start is not None:
        network.load_state_dict(run.start.checkpoint.network.state_dict())
    # The networks of earlier rounds: their errors raise the chance of a point to be selected.
    graders = [Checkpoint.load(run.round_path(each)).network for each in range(1, progress.round)]
    # looks: how often an epoch uses each picture
    total = recipe.epochs * steps_an_epoch(recipe.looks * run.data.pictures_per_epoch, recipe.batch)
    shares, weights = run.shares_and_weights(progress.round)
    peaks = run.configuration.peak_numbers
    trainer = Trainer(network, recipe, total, shares, weights, graders, hardware.device, peaks)
    if run.state_path.exists():
        state = read_state(run.state_path)
        if state["more"]["round"] == progress.round:
            trainer.load(state)
    return trainer


def _remaining_batches(run: TrainingRun, training_round: int, done: int, validated: int) -> Iterator[Batch]:
    """Batches of a round that are left after `done` steps and `validated` validated epochs.

    A batch counts its epoch from 0, its step from 1.
    """
    for batch in run.data.batches(run.configuration.training, training_round):
        remains = batch.epoch >= validated if batch.validates else batch.step > done
        if remains:
            yield batch


@contextmanager
def _saved_on_error(folder: Path, save: Callable[[], None]) -> Iterator[None]:
    """Save the state when a picture ends the training, and tell how to resume.

    A training that diverged would do so again, so it is not saved.
    """
    try:
        yield
    except DivergedError:
        raise
    except InputError as error:
        save()
        raise InputError(f"{error}; continue with vm-train resume {folder}") from error


def _mean_precision(known: dict[str, float], objects: Sequence[str]) -> float:
    """Mean average precision of the objects among the known classes; of all known classes if there is no object."""
    seen = [known[name] for name in objects if name in known]
    return float(np.mean(seen or list(known.values()) or [0.0]))
