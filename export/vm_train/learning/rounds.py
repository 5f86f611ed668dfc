"""The rounds of a training: networks one after the other, each chosen by its validation, all of it resumable."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
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
from vm_export.network import Network

from ..graphs.loading import load_batches
from ..graphs.schedule import Batch, steps_an_epoch
from ..scores.point_scores import PointScores
from .hardware import Hardware
from .log import TrainingLog
from .run_folder import TrainingRun
from .selection import class_weights, selection_shares
from .trainer import Trainer, read_state, sum_over_processes

_SAVED = 30.0  # seconds between states


@dataclass
class TrainingProgress:
    """How far a training is beside its weights.

    round: counted from 1. finished: whether the round is. validated: epochs of it that are. best: score of its best
    network, and best_epoch, counted from 1, where it was reached. best_ever: of all rounds.
    """

    round: int = 1
    finished: bool = False
    validated: int = 0
    best: float = -1.0
    best_epoch: int = 0
    best_ever: float = -1.0


@dataclass(frozen=True)
class TrainingOutcome:
    """What a call of `train` came to. finished: or stopped on request."""

    finished: bool
    progress: TrainingProgress
    pictures: int
    seconds: float


def train(job: TrainingRun, hardware: Hardware, stopped: Callable[[], bool]) -> TrainingOutcome:
    """Do all that is left of a training, or as much as there is until `stopped` says so. Raises InputError.

    The final weights are the same however often it was stopped or killed.
    """
    began = perf_counter()
    progress = TrainingProgress()
    if job.state_path.exists():
        progress = TrainingProgress(**read_state(job.state_path)["more"])
    pictures = 0
    while True:
        if progress.finished:
            if progress.round == job.configuration.training.trainings:
                return TrainingOutcome(True, progress, pictures, perf_counter() - began)
            progress = TrainingProgress(round=progress.round + 1, best_ever=progress.best_ever)
        pictures += _train_round(job, hardware, progress, stopped)
        if not progress.finished:
            return TrainingOutcome(False, progress, pictures, perf_counter() - began)


def _train_round(job: TrainingRun, hardware: Hardware, progress: TrainingProgress, stopped: Callable[[], bool]) -> int:
    """Do what is left of a round, and return the number of pictures that were looked at."""
    training = _prepared(job, hardware, progress)
    recipe = job.configuration.training
    # The loader is some batches ahead of the training; a list of all would not fit into memory for large sets.
    batches, ahead = tee(_left(job, progress.round, training.done, progress.validated))
    own = (each.part(hardware.rank, hardware.size) for each in ahead)
    scores = PointScores(tuple(job.configuration.classes.colors))
    bar = ProgressBar(training.total, "vm-train", training.done)
    pictures, saved = 0, perf_counter()

    def save() -> None:
        if hardware.is_leader:
            training.save(job.state_path, asdict(progress))

    with (
        TrainingLog(job.folder, progress.round, training.done, progress.validated, hardware.is_leader) as log,
        _resumable(job.folder, save),
        closing(load_batches(job.scheduled(), own, hardware.workers)) as loader,
    ):
        for whole, found in zip(batches, loader, strict=True):
            batch = whole.part(hardware.rank, hardware.size)
            pictures += len(whole.items)
            if batch.validates:
                for each in found:
                    scores.add(training.probabilities(each), each.labels, each.distances)
                if batch.last:
                    _validated(job, hardware, progress, training, log, scores)
                    scores = PointScores(tuple(job.configuration.classes.colors))
                    if recipe.patience and progress.validated - progress.best_epoch >= recipe.patience:
                        break
                    save()
            else:
                step = training.step(batch.items, found)
                log.write(step.number, {"loss": step.loss, "points": step.points, "rate": step.rate})
                bar.advance()
                if batch.last or perf_counter() - saved > _SAVED:
                    save()
                    saved = perf_counter()
            if sum_over_processes(torch.tensor(float(stopped()))) > 0.0:
                if not batch.validates:
                    save()
                bar.clear()
                return pictures
    bar.clear()
    progress.finished = True
    save()
    hardware.broadcast(None)  # the next round reads what the leading process has written by now
    return pictures


def _prepared(job: TrainingRun, hardware: Hardware, progress: TrainingProgress) -> Trainer:
    """A round's training as far as it is."""
    recipe = job.configuration.training
    torch.manual_seed(int(np.random.default_rng([recipe.seed, progress.round]).integers(2**31)))
    network = Network(job.configuration.network_shape)
    rule = recipe.selection_of(progress.round)
    graders = [Checkpoint.load(job.round_path(each)).last_network for each in range(1, progress.round)]
    total = recipe.epochs * steps_an_epoch(recipe.looks * job.epoch, recipe.batch)
    shares, weights = selection_shares(rule, job.counts, job.objects), class_weights(rule, job.counts, recipe.balance)
    teacher = None if job.teacher is None else job.teacher.checkpoint.network
    training = Trainer(network, recipe, total, shares, weights, graders, teacher, hardware.device)
    if job.state_path.exists():
        state = read_state(job.state_path)
        if state["more"]["round"] == progress.round:
            training.load(state)
    return training


def _left(job: TrainingRun, training_round: int, done: int, validated: int) -> Iterator[Batch]:
    """Batches of a round that are left after so many steps and validated epochs."""
    for batch in job.batches(training_round):
        if batch.epoch >= validated if batch.validates else batch.step > done:
            yield batch


@contextmanager
def _resumable(folder: Path, save: Callable[[], None]) -> Iterator[None]:
    """Save the state when a picture or shard ends the training, and say how it goes on."""
    try:
        yield
    except InputError as error:
        save()
        raise InputError(f"{error}; vm-train resume {folder} goes on") from error


def _validated(
    job: TrainingRun,
    hardware: Hardware,
    progress: TrainingProgress,
    training: Trainer,
    log: TrainingLog,
    own: PointScores,
) -> None:
    """Score a network, and keep it if it is the best so far."""
    first, *others = hardware.gather(own)
    scores = sum(others, start=first)
    precisions = {name: scores.ranking(name).precision_recall.average_precision for name in scores.classes}
    score, unseen = _score(job, precisions)
    progress.validated += 1
    if unseen and progress.validated == 1 and hardware.is_leader:
        print(
            f"vm-train: the validation shows no {' or '.join(unseen)}: networks are chosen by all classes",
            file=sys.stderr,
        )
    known = {name: value for name, value in precisions.items() if not math.isnan(value)}
    log.write(training.done, {"epoch": progress.validated, "score": score, "average_precision": known})
    if score <= progress.best:
        return
    progress.best, progress.best_epoch = score, progress.validated
    best_ever, progress.best_ever = progress.best_ever, max(progress.best_ever, score)
    if not hardware.is_leader:
        return
    provenance = job.provenance() | {
        "round": str(progress.round),
        "epoch": str(progress.validated),
        "validation_average_precision": f"{score:.4f}",
        "torch": torch.__version__,
    }
    manifest = replace(job.configuration.manifest, provenance=provenance)
    network = training.result if job.first is None else job.first.then(training.result)
    checkpoint = Checkpoint(network, manifest, job.configuration.grid)
    checkpoint.save(job.round_path(progress.round))
    if score > best_ever:
        checkpoint.save(job.model_path)


def _score(job: TrainingRun, precisions: dict[str, float]) -> tuple[float, list[str]]:
    """Mean average precision of the objects that occur, else of all classes that do; and the objects if none does."""
    objects = [name for name, kind in job.configuration.classes.kinds.items() if kind == "object"]
    known = {name: value for name, value in precisions.items() if not math.isnan(value)}
    seen = [known[name] for name in objects if name in known]
    return float(np.mean(seen or list(known.values()) or [0.0])), [] if seen else objects
