"""Training is repeatable: from a seed, after an interruption, and with several processes."""

from pathlib import Path

import numpy as np
import pytest
import torch

from vm_embedded.errors import InputError
from vm_export.network import Network, NetworkShape
from vm_train.graphs import Graph, together
from vm_train.training import Recipe, Training

COUNT = 6


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
    return Graph(points, neighbors, labels, np.linspace(0.0, 10.0, n))


def load(batches):
    return ([graph(each.position) for each in items] for items in batches)


def training(recipe=None):
    torch.manual_seed(3)
    network = Network(NetworkShape.uniform(depth=3, width=4, classes=2))
    return Training(network, recipe or Recipe(epochs=3, batch=2, seed=5), COUNT)


def weights(made):
    return {name: value.clone() for name, value in made.network.state_dict().items()}


def same(first, second):
    return all(torch.equal(first[name], second[name]) for name in first)


def test_graphs_together_answer_as_they_do_alone():
    network = Network(NetworkShape.uniform(depth=3, width=4, classes=2))
    graphs = [graph(each) for each in range(3)]
    joined, starts = together(graphs)
    assert starts.tolist() == [0, 40, 80, 120]
    whole = network(torch.from_numpy(joined.points), torch.from_numpy(joined.neighbors))
    for each, start in zip(graphs, starts, strict=False):
        alone = network(torch.from_numpy(each.points), torch.from_numpy(each.neighbors))
        assert torch.allclose(whole[start : start + len(each)], alone[:-1], atol=1e-6)
        assert torch.allclose(whole[-1], alone[-1], atol=1e-6)
    assert joined.labels.tolist() == np.concatenate([each.labels for each in graphs]).tolist()


def test_it_learns():
    steps = list(training(Recipe(epochs=60, batch=3, rate=0.02)).run(load))
    assert len(steps) == 120
    assert np.mean([each.loss for each in steps[-6:]]) < 0.3 * np.mean([each.loss for each in steps[:6]])


@pytest.mark.parametrize(
    "recipe", [Recipe(epochs=3, batch=4), Recipe(epochs=3, batch=2, optimizer="sgd", schedule="constant", loss="focal")]
)
@pytest.mark.parametrize("stop", [1, 3, 4])
def test_what_is_interrupted_ends_with_the_same_weights(recipe, stop, tmp_path):
    whole = training(recipe)
    losses = [each.loss for each in whole.run(load)]

    first = training(recipe)
    before = [each.loss for each in first.run(load, until=stop)]
    first.save(tmp_path / "state.pt")
    second = training(recipe)
    second.load(tmp_path / "state.pt")
    after = [each.loss for each in second.run(load)]
    assert before + after == losses
    assert same(weights(second), weights(whole))


def test_the_same_seed_gives_the_same_weights_and_another_one_others():
    runs = []
    for seed in (1, 1, 2):
        made = training(Recipe(epochs=2, batch=2, seed=seed))
        list(made.run(load))
        runs.append(weights(made))
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])


def test_a_damaged_state_is_refused(tmp_path):
    (tmp_path / "state.pt").write_bytes(b"no state")
    with pytest.raises(InputError, match="can't go on"):
        training().load(tmp_path / "state.pt")


def _part(rank, size, folder):
    """One of `size` processes that train together."""
    torch.distributed.init_process_group("gloo", init_method=f"file://{folder}/meet", rank=rank, world_size=size)
    made = training(Recipe(epochs=2, batch=4, selection="all"))
    losses = [each.loss for each in made.run(load)]
    torch.save({"losses": losses, "network": weights(made)}, Path(folder) / f"rank{rank}.pt")
    torch.distributed.destroy_process_group()


@pytest.mark.slow
def test_two_processes_train_as_one(tmp_path):
    alone = training(Recipe(epochs=2, batch=4, selection="all"))
    losses = [each.loss for each in alone.run(load)]
    torch.multiprocessing.spawn(_part, args=(2, str(tmp_path)), nprocs=2)
    parts = [torch.load(tmp_path / f"rank{rank}.pt") for rank in range(2)]
    assert same(parts[0]["network"], parts[1]["network"])
    assert parts[0]["losses"] == pytest.approx(losses, rel=1e-4)
    for name, value in weights(alone).items():
        assert torch.allclose(parts[0]["network"][name], value, atol=1e-4)
