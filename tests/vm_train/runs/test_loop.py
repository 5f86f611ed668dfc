"""The loop of all trainings, with a network of three weights: it stops anywhere and goes on as if it had not."""

from contextlib import suppress
from itertools import chain, repeat

import numpy as np
import pytest
import torch
from torch import nn

from vm_embedded.errors import InputError
from vm_train.runs.hardware import Hardware
from vm_train.runs.learner import DivergedError, Learner
from vm_train.runs.log import read_log
from vm_train.runs.loop import Progress, Training, Validation, train
from vm_train.runs.optimizer import ScheduledOptimizer
from vm_train.runs.run import Run

ROUNDS, EPOCHS, STEPS = 2, 3, 4
ALONE = Hardware("cpu", 0, 1, 0)


class LineRun(Run):
    @property
    def result_path(self):
        return self.folder / "line.pt"


class LineTraining(Training):
    """Fits a plane. scores: of the epochs. bad: a step that raises this error."""

    def __init__(self, folder, scores=(1.0, 2.0, 3.0), patience=0, bad=None):
        super().__init__()
        folder.mkdir(exist_ok=True)
        self.run = LineRun(folder, {}, 1)
        self.rounds, self.epochs, self.steps, self.patience = ROUNDS, EPOCHS, STEPS, patience
        self._scores, self._bad = scores, bad

    def begin(self, progress, stopped):
        self._progress, self._stopped, self.title = progress, stopped, f"round {progress.round}, "
        torch.manual_seed(progress.round)
        network = nn.Linear(2, 1)
        total = EPOCHS * STEPS
        self.learner = Learner(network, ScheduledOptimizer(network, "adamw", 0.05, 0.0, total), total, "cpu")

    def step(self):
        if self._bad is not None and self.learner.done == 2:
            raise self._bad
        random = np.random.default_rng([self._progress.round, self.learner.done])
        places = torch.from_numpy(random.random((8, 2), dtype=np.float32))
        rate, loss = self.learner.rate, (self.learner.network(places)[:, 0] - places.sum(dim=1)).square().mean()
        self.learner.learn(loss.item(), loss)
        return {"loss": loss.item(), "rate": rate}

    def validate(self):
        if self._stopped():
            raise KeyboardInterrupt
        score = self._scores[self._progress.validated]
        if self._progress.is_best(score):
            self.kept = {"weight": self.learner.network.weight.detach().clone()}
            self._progress.take(score)
        return Validation({"score": score}, f"score {score}")

    def finish(self):
        path = self.run.folder / f"round{self._progress.round}"
        path.write_bytes(
            b"".join(each.numpy().tobytes() for each in [*self.kept.values(), self.learner.network.bias.data])
        )


def results(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name in ("round1", "round2", "log.jsonl")}


def epochs(folder):
    return [(each["round"], each["epoch"]) for _, each in read_log(folder / "log.jsonl") if "epoch" in each]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    assert train(LineTraining(folder), ALONE, lambda: False)
    return folder


def test_it_learns_in_rounds_and_epochs(whole):
    assert epochs(whole) == [(number, epoch) for number in (1, 2) for epoch in (1, 2, 3)]
    assert not train(LineTraining(whole), ALONE, lambda: False)


def test_what_stops_at_every_question_ends_with_the_same_bytes(whole, tmp_path):
    runs = 0
    while True:
        runs += 1
        one_more = chain([False], repeat(True)).__next__  # lets one step or validation pass
        with suppress(KeyboardInterrupt):
            train(LineTraining(tmp_path), ALONE, one_more)
            break
    assert runs >= ROUNDS * EPOCHS * STEPS / 2
    assert results(tmp_path) == results(whole)


def test_a_round_ends_when_it_has_not_become_better_for_too_long(tmp_path):
    train(LineTraining(tmp_path, scores=(2.0, 1.0, 3.0), patience=1), ALONE, lambda: False)
    assert epochs(tmp_path) == [(1, 1), (1, 2), (2, 1), (2, 2)]


def test_a_picture_that_ends_the_training_is_named_and_it_goes_on_when_that_is_repaired(whole, tmp_path):
    with pytest.raises(InputError, match=f"image7 is gone; continue with vm-train resume {tmp_path}"):
        train(LineTraining(tmp_path, bad=InputError("image7 is gone")), ALONE, lambda: False)
    train(LineTraining(tmp_path), ALONE, lambda: False)
    assert results(tmp_path) == results(whole)


def test_a_training_that_diverged_is_not_saved(tmp_path):
    with pytest.raises(DivergedError, match=r"^NaN$"):
        train(LineTraining(tmp_path, bad=DivergedError("NaN")), ALONE, lambda: False)
    assert not (tmp_path / "state.pt").exists()


def test_scores_that_are_not_measured_keep_the_last_network():
    progress = Progress()
    for score in (1.0, float("nan"), float("nan")):
        assert progress.is_best(score)
        progress.take(score)
    assert not Progress(best=2.0).is_best(2.0)
