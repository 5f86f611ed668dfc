"""The training of a mesh network.

Each round trains a new network, from random weights or from those of a trained network (start.py), and keeps its best
epoch in a checkpoint. Validation AP is the average precision of the mesh points of the classes that are objects, or of
all classes if none is.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import tee
from time import perf_counter

import numpy as np
import torch

from vm_export.checkpoint import Checkpoint
from vm_export.mesh_networks import new_network

from ..graphs.labeled_graph import LabeledGraph
from ..graphs.loading import load_batches
from ..graphs.schedule import Batch, steps_an_epoch
from ..runs.hardware import Hardware
from ..runs.loop import Progress, Training, Validation
from ..scores.point_scores import PointScores
from .run import MeshRun
from .trainer import Trainer


class MeshTraining(Training):
    """See runs.loop.Training. pictures: number of those that all steps and validations used so far, in this process."""

    run: MeshRun
    learner: Trainer
    _loader: Generator[list[LabeledGraph]] | None

    def __init__(self, run: MeshRun, hardware: Hardware) -> None:
        self.run, self._hardware, recipe = run, hardware, run.configuration.training
        super().__init__()
        self.rounds, self.patience, self.epochs = recipe.trainings, recipe.patience, recipe.epochs
        # repeats: how often an epoch uses each picture
        self.steps = steps_an_epoch(recipe.repeats * len(run.split.training), recipe.batch)
        self.pictures, self._began = 0, perf_counter()

    @property
    def speed(self) -> float:
        """Pictures per second so far, of all processes."""
        return self.pictures / max(perf_counter() - self._began, 1e-9)

    def begin(self, progress: Progress, stopped: Callable[[], bool]) -> None:
        """Prepare a new network."""
        run, number, recipe = self.run, progress.round, self.run.configuration.training
        self._progress, self._stopped, self._loader = progress, stopped, None
        if self.rounds > 1:
            self.title = f"round {number} of {self.rounds}, "
        torch.manual_seed(int(np.random.default_rng([recipe.seed, number]).integers(2**31)))
        network = new_network(run.configuration.network_shape)
        if run.start is not None:
            network.load_state_dict(run.start.checkpoint.network.state_dict())
        # The networks of earlier rounds: their errors raise the chance of a point to be selected.
        graders = [Checkpoint.load(run.round_path(each)).network for each in range(1, number)]
        shares, weights = run.shares_and_weights(number)
        device, peaks = self._hardware.device, run.configuration.peak_numbers
        total = recipe.epochs * self.steps
        self.learner = Trainer(network, recipe, total, shares, weights, graders, device, peaks)

    def step(self) -> dict[str, float]:
        """Learn from this process's part of the next batch."""
        batch, graphs = self._next()
        return self.learner.step(batch.items, graphs)

    def validate(self) -> Validation:
        """Score the network over all processes, and keep it if it is the best so far."""
        classes, batch = self.run.configuration.classes, None
        own = PointScores(tuple(classes.colors))
        while batch is None or not batch.last:
            batch, graphs = self._next()
            for each in graphs:
                own.add(self.learner.probabilities(each), each.labels, each.distances)
            if self._stopped():
                raise KeyboardInterrupt
        first, *others = self._hardware.gather(own)
        scores = sum(others, start=first)
        precisions = {name: scores.ranking(name).precision_recall.average_precision for name in scores.classes}
        known = {name: value for name, value in precisions.items() if not math.isnan(value)}
        objects = [name for name, kind in classes.kinds.items() if kind == "object"]
        seen = [known[name] for name in objects if name in known]
        if objects and not seen and not self._progress.validated and self._hardware.is_leader:
            print(
                f"vm-train: the validation pictures show no {' or '.join(objects)}: the validation AP is the mean "
                "of all classes",
                file=sys.stderr,
            )
        precision = float(np.mean(seen or list(known.values()) or [0.0]))
        if self._progress.is_best(precision):
            self._keep(precision)
            self._progress.take(precision)
        record = {"validation_average_precision": precision, "average_precision": known}
        return Validation(record, f"validation AP {precision:.3f}", f", {self.speed:.0f} pictures/s")

    def finish(self) -> None:
        """Wait until the leader has written the network that the next round reads."""
        self._hardware.broadcast(None)
        if self._progress.round == self.rounds and self._hardware.is_leader:
            best = f"validation AP {self._progress.best_ever:.3f}"
            print(f"{self.run.result_path}: {best}, {self.speed:.0f} pictures/s")

    def _next(self) -> tuple[Batch, list[LabeledGraph]]:
        """This process's part of the next batch, and its graphs."""
        if self._loader is None:
            # Two iterators: the workers take batches `ahead` of time, and the loop takes the same `batches` in step
            # with their graphs. A list of all would not fit into memory for large sets.
            self._batches, ahead = tee(self._remaining())
            own = (each.part(self._hardware.rank, self._hardware.size) for each in ahead)
            self._loader = load_batches(self.run.graphs(), own, self._hardware.workers)
            self.held.enter_context(closing(self._loader))
        whole = next(self._batches)
        self.pictures += len(whole.items)
        return whole.part(self._hardware.rank, self._hardware.size), next(self._loader)

    def _remaining(self) -> Iterator[Batch]:
        """Batches of the round that are left. A batch counts its epoch from 0, its step from 1."""
        done, validated = self.learner.done, self._progress.validated
        for batch in self.run.batches(self._progress.round):
            remains = batch.epoch >= validated if batch.validates else batch.step > done
            if remains:
                yield batch

    def _keep(self, precision: float) -> None:
        """Write the round's best network, and the best of all rounds if it is that, too."""
        progress, run = self._progress, self.run
        if not self._hardware.is_leader:
            return
        provenance = run.provenance() | {
            "round": str(progress.round),
            "epoch": str(progress.validated + 1),
            "validation_average_precision": f"{precision:.4f}",
            "torch": torch.__version__,
        }
        manifest = replace(run.configuration.manifest, provenance=provenance)
        checkpoint = Checkpoint(self.learner.network, manifest, run.configuration.grid)
        checkpoint.save(run.round_path(progress.round))
        if precision > progress.best_ever:
            checkpoint.save(run.result_path)
