"""Networks on strips learn, and do so repeatably: after an interruption, and whatever a batch shows."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.manifests import ball_manifest
from tests.vm_train.learning.test_trainer import weights
from tests.vm_train.weights import same
from vm_export.canvas_network import CanvasNetwork
from vm_export.canvas_shape import CanvasShape
from vm_export.torch_files import load_values, save_values
from vm_train.graphs.labeled_graph import CONTEXT, LabeledGraph, empty_graph
from vm_train.graphs.schedule import Item, schedule
from vm_train.learning.configuration import Recipe
from vm_train.learning.trainer import Trainer

COUNT = 4
RECIPES = {
    "muon": Recipe(epochs=3, batch=2, optimizer="muon", rate=0.02),
    "adamw": Recipe(epochs=3, batch=3),
}
NOTHING = empty_graph(ball_manifest(mesh="octaves"))


def graph(position, rows=13, columns=30):
    """A strip in whose rows and columns bright points are of class 1, with context around."""
    random = np.random.default_rng([position, 17])
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.int32)
    points = random.random((len(cells) + 1, 3), dtype=np.float32)
    points[-1] = -1.0
    labels = (points[:-1].mean(axis=1) > 0.5).astype(np.int8)
    labels[::7] = -1
    labels[(cells == 0).any(axis=1)] = CONTEXT
    neighbors = np.zeros((len(cells) + 1, 0), dtype=np.int32)
    return LabeledGraph(points, neighbors, labels, np.linspace(0.0, 10.0, len(cells)), np.zeros((len(cells), 2)), cells)


def network(seed=3):
    torch.manual_seed(seed)
    return CanvasNetwork(CanvasShape(1, 8, 2))


def batches_of(recipe):
    return list(schedule((recipe.seed, 1), recipe.epochs, recipe.batch, COUNT, 0))


def training(recipe, graders=()):
    return Trainer(network(), recipe, len(batches_of(recipe)), np.array([0.7, 1.0]), np.array([1.5, 0.5]), graders)


def run(made, until=None):
    """Losses of the steps that are left, or of those before `until`."""
    batches = batches_of(made.recipe)[made.done : until]
    return [made.step(each.items, [graph(item.position) for item in each.items])["loss"] for each in batches]


def test_it_learns_what_a_checkpoint_then_knows():
    """Batch normalization by the statistics of the whole training gives about the answers of the last batches."""
    made = training(Recipe(epochs=30, batch=2, rate=0.02))
    losses = run(made)
    assert np.mean(losses[-6:]) < 0.3 * np.mean(losses[:6])
    for position in range(COUNT):
        shown = graph(position)
        labeled = shown.labels >= 0
        found = made.probabilities(shown)
        assert (found.argmax(axis=1) == shown.labels)[labeled].mean() > 0.9
    assert made.network.training


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
@pytest.mark.parametrize("stop", [1, 4])
def test_what_is_interrupted_ends_with_the_same_weights(recipe, stop, tmp_path):
    whole = training(recipe)
    losses = run(whole)
    first = training(recipe)
    before = run(first, until=stop)
    first.probabilities(graph(0))  # a validation, which no training may notice
    save_values(tmp_path / "state.pt", first.state())
    second = training(recipe)
    second.load(load_values(tmp_path / "state.pt", "a state"))
    assert before + run(second) == losses
    assert same(weights(second), weights(whole))


def test_graders_answer_as_trained_networks_and_stay_as_they_are():
    graders = [network(8), network(9)]
    before = [{name: value.clone() for name, value in each.state_dict().items()} for each in graders]
    first, second = training(RECIPES["muon"]), training(RECIPES["muon"], graders)
    run(first), run(second)
    assert not same(weights(first), weights(second))
    assert all(same(each.state_dict(), old) for each, old in zip(graders, before, strict=True))


def test_a_batch_without_points_changes_nothing():
    made = training(RECIPES["muon"])
    before = weights(made)
    step = made.step(batches_of(made.recipe)[0].items[:1], [NOTHING])
    assert (step["loss"], made.done) == (0.0, 1)
    assert same(weights(made), before)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (3, 8)])
def test_a_window_of_a_few_points_is_learned_from(shape):
    """A canvas of one cell at the coarsest resolution would have no deviation to divide by."""
    made = training(RECIPES["muon"])
    small = graph(2, *shape)
    small.labels[:] = 1
    step = made.step(batches_of(made.recipe)[0].items[:1], [small])
    assert step["points"] == len(small)
    assert np.isfinite(step["loss"])
    assert all(torch.isfinite(each).all() for each in weights(made).values())


def test_context_gives_no_gradient_but_is_seen():
    made = training(RECIPES["muon"])
    shown = graph(0)
    hidden = graph(0)
    hidden.points[:-1][hidden.labels == CONTEXT] = 0.0
    assert not np.array_equal(made.probabilities(shown), made.probabilities(hidden))
    shown.labels[:] = CONTEXT
    before = {name: each for name, each in weights(made).items() if "running" not in name and "batches" not in name}
    assert made.step(batches_of(made.recipe)[0].items[:1], [shown])["points"] == 0
    after = weights(made)
    assert same({name: after[name] for name in before}, before)


@pytest.mark.long
def test_it_learns_where_objects_are():
    """Their cells, the way to them, and their sizes, from colors that tell all three."""
    made = Trainer(
        CanvasNetwork(CanvasShape(1, 8, 2, 1)),
        Recipe(epochs=120, batch=2, optimizer="muon", rate=0.02),
        240,
        np.ones(2),
        np.ones(2),
        peaks=(1,),
    )

    def spotted(position):
        shown = graph(position)
        random = np.random.default_rng(position)
        shown.labels[shown.labels >= 0] = 0
        objects = []
        for column, row in ((6.0, 4.0), (15.0, 8.0), (23.0, 5.0)):
            place, size = np.array([column, row]) + random.uniform(-0.4, 0.4, 2), float(random.uniform(-0.5, 0.5))
            objects.append((1.0, *place, size, 1.0))
            step = place - shown.cells
            near = np.hypot(*step.T) < 1.6
            shown.points[:-1][near] = np.column_stack([0.5 + 0.3 * step, np.full(len(step), 2.0 + size)])[near]
        return replace(shown, objects=np.array(objects, np.float32))

    items = [Item(each, (each,)) for each in range(2)]
    for step in range(240):
        made.step(items, [spotted(2 * step), spotted(2 * step + 1)])
    shown = spotted(1000)
    made.network.eval()
    with torch.inference_mode():
        logits = made.network.logits(torch.from_numpy(shown.points), torch.from_numpy(shown.cells))[:-1, 2:].numpy()
    apart = np.hypot(*np.moveaxis(shown.objects[:, None, 1:3] - shown.cells, 2, 0))
    own, beyond = apart.argmin(axis=1), (apart > 2.5).all(axis=0) & (shown.labels >= 0)
    assert logits[own, 0].min() > logits[beyond, 0].max() + 2.0
    ways = np.column_stack([shown.cells[own] + logits[own, 1:3], logits[own, 3]])
    np.testing.assert_allclose(ways, shown.objects[:, 1:4], atol=0.3)
    assert made.probabilities(shown).shape == (len(shown), 2)
