"""Training is repeatable: from a seed, after an interruption, and with several processes."""

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.manifests import ball_manifest
from tests.vm_train.weights import same
from vm_embedded.errors import InputError
from vm_export.network import Network
from vm_export.network_shape import NetworkShape
from vm_export.torch_files import load_values, save_values
from vm_train.graphs.labeled_graph import LabeledGraph, empty_graph, join_graphs
from vm_train.graphs.schedule import schedule
from vm_train.learning.configuration import Recipe
from vm_train.learning.trainer import Trainer
from vm_train.runs.hardware import process_group
from vm_train.runs.loop import read_state

COUNT = 6
SHARES = np.array([0.7, 1.0])
WEIGHTS = np.array([1.5, 0.5])
RECIPES = {
    "adamw": Recipe(epochs=3, batch=4),
    "sgd": Recipe(epochs=3, batch=2, optimizer="sgd", schedule="constant", loss="focal"),
    "muon": Recipe(epochs=3, batch=4, optimizer="muon", rate=0.02),
    "mixed": Recipe(epochs=3, batch=4, precision="mixed", clip=0.0),
}


def graph(position):
    """Forty points in a row, linked to those beside them; bright ones are of class 1."""
    random = np.random.default_rng([position, 17])
    n = 40
    points = random.random((n + 1, 3), dtype=np.float32)
    points[-1] = -1.0
    places = np.arange(n)[:, None] + (-1, 1, -2, 2, -3, 3)
    neighbors = np.where((places >= 0) & (places < n), places, n)
    neighbors = np.concatenate([neighbors, np.full((1, 6), n)]).astype(np.int32)
    labels = (points[:-1].mean(axis=1) > 0.5).astype(np.int8)
    labels[::7] = -1
    return LabeledGraph(points, neighbors, labels, np.linspace(0.0, 10.0, n), np.zeros((n, 2)))


def network(seed=3):
    torch.manual_seed(seed)
    return Network(NetworkShape.uniform(depth=3, width=4, classes=2))


def batches_of(recipe):
    return list(schedule((recipe.seed, 1), recipe.epochs, recipe.batch, COUNT, 0))


def training(recipe=None, graders=()):
    recipe = recipe or Recipe(epochs=3, batch=2, seed=5)
    return Trainer(network(), recipe, len(batches_of(recipe)), SHARES, WEIGHTS, graders)


def run(made, until=None, rank=0, size=1):
    """Losses of the steps that are left, or of those before `until`."""
    losses = []
    for batch in batches_of(made.recipe)[made.done : until]:
        own = batch.part(rank, size)
        losses.append(made.step(own.items, [graph(each.position) for each in own.items])["loss"])
    return losses


def weights(made):
    return {name: value.clone() for name, value in made.network.state_dict().items()}


def test_graphs_together_answer_as_they_do_alone():
    made = network()
    graphs = [graph(each) for each in range(3)]
    joined, starts = join_graphs(graphs)
    assert starts.tolist() == [0, 40, 80, 120]
    whole = made(torch.from_numpy(joined.points), torch.from_numpy(joined.neighbors))
    for each, start in zip(graphs, starts, strict=False):
        alone = made(torch.from_numpy(each.points), torch.from_numpy(each.neighbors))
        assert torch.allclose(whole[start : start + len(each)], alone[:-1], atol=1e-6)
        assert torch.allclose(whole[-1], alone[-1], atol=1e-6)
    assert joined.labels.tolist() == np.concatenate([each.labels for each in graphs]).tolist()


def test_it_learns():
    losses = run(training(Recipe(epochs=60, batch=3, rate=0.02)))
    assert len(losses) == 120
    assert np.mean(losses[-6:]) < 0.3 * np.mean(losses[:6])


@pytest.mark.parametrize("recipe", RECIPES.values(), ids=RECIPES)
@pytest.mark.parametrize("stop", [1, 3, 4])
def test_what_is_interrupted_ends_with_the_same_weights(recipe, stop, tmp_path):
    whole = training(recipe)
    losses = run(whole)

    first = training(recipe)
    before = run(first, until=stop)
    save_values(tmp_path / "state.pt", first.state())
    second = training(recipe)
    second.load(load_values(tmp_path / "state.pt", "a state"))
    assert before + run(second) == losses
    assert same(weights(second), weights(whole))


def test_the_same_seed_gives_the_same_weights_and_another_one_others():
    runs = []
    for seed in (1, 1, 2):
        made = training(Recipe(epochs=2, batch=2, seed=seed))
        run(made)
        runs.append(weights(made))
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])


def test_graders_change_which_points_are_selected_but_hardly_how_many():
    recipe = Recipe(epochs=40, batch=2)
    first, second = training(recipe), training(recipe, graders=[network(8), network(9)])
    run(first), run(second)
    assert not same(weights(first), weights(second))


def test_a_batch_without_points_changes_no_weights():
    made = training()
    before = weights(made)
    step = made.step(batches_of(made.recipe)[0].items[:1], [empty_graph(ball_manifest())])
    assert (step["loss"], made.done) == (0.0, 1)
    assert same(weights(made), before)


@pytest.mark.parametrize("content", [b"no state", b""])
def test_a_damaged_state_is_refused(content, tmp_path):
    (tmp_path / "state.pt").write_bytes(content)
    with pytest.raises(InputError, match=r"can't resume: .*state\.pt"):
        read_state(tmp_path / "state.pt")


def test_a_state_of_another_network_is_refused():
    other = Trainer(Network(NetworkShape.uniform(depth=2, width=4, classes=2)), Recipe(), 5, SHARES, WEIGHTS)
    with pytest.raises(InputError, match="another training"):
        other.load(training().state())


def _part(rank, size, folder, hard):
    """One of `size` processes that train together."""
    torch.set_num_threads(1)
    with process_group("gloo", init_method=f"file://{folder}/meet", rank=rank, world_size=size):
        made = training(Recipe(epochs=2, batch=4), [network(8)] if hard else ())
        losses = run(made, rank=rank, size=size)
        torch.save({"losses": losses, "network": weights(made)}, Path(folder) / f"rank{rank}.pt")
    threads = [each.read_text().strip() for each in Path("/proc/self/task").glob("*/comm")]
    assert not [each for each in threads if "gloo" in each], "threads of the group outlive it and may abort the exit"


@pytest.mark.long
@pytest.mark.parametrize("hard", [False, True])
def test_two_processes_train_as_one(hard, tmp_path):
    alone = training(Recipe(epochs=2, batch=4), [network(8)] if hard else ())
    losses = run(alone)
    torch.multiprocessing.spawn(_part, args=(2, str(tmp_path), hard), nprocs=2)
    parts = [torch.load(tmp_path / f"rank{rank}.pt") for rank in range(2)]
    assert same(parts[0]["network"], parts[1]["network"])
    assert parts[0]["losses"] == pytest.approx(losses, rel=1e-4)
    for name, value in weights(alone).items():
        assert torch.allclose(parts[0]["network"][name], value, atol=1e-4)
