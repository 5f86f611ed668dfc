"""Measured normalizations leave a network's answers as they are, and suit its training mode."""

import pytest
import torch
from torch import nn

from benchmarks.peers.normalization import measure


def exported_network() -> nn.Module:
    """Two convolutions whose normalizations only add a bias, as in a network from an exported one."""
    torch.manual_seed(0)
    network = nn.Sequential(
        *(nn.Conv2d(3, 8, 3, bias=False), nn.BatchNorm2d(8, eps=1e-3), nn.SiLU()),
        *(nn.Conv2d(8, 4, 3, bias=False), nn.BatchNorm2d(4, eps=1e-3)),
    )
    with torch.no_grad():
        for layer in (network[1], network[4]):
            layer.bias.normal_()
            layer.weight.copy_((layer.running_var + layer.eps).sqrt())
        network[0].weight.mul_(20.0)
    return network.eval()


@pytest.fixture
def batches():
    torch.manual_seed(1)
    return [3.0 * torch.rand(6, 3, 24, 20) - 1.0 for _ in range(4)]


def test_the_answers_stay_the_same(batches):
    network = exported_network()
    before = network(batches[0])
    measure(network, batches)
    assert not network.training
    torch.testing.assert_close(network(batches[0]), before, rtol=1e-4, atol=1e-4)


def test_the_statistics_are_those_of_the_inputs_of_each_normalization(batches):
    network = exported_network()
    measure(network, batches)
    x = torch.cat(batches)
    for at in (1, 4):
        inputs = network[:at](x)
        torch.testing.assert_close(network[at].running_mean, inputs.mean(dim=(0, 2, 3)), rtol=1e-3, atol=1e-4)
        torch.testing.assert_close(network[at].running_var, inputs.var(dim=(0, 2, 3)), rtol=1e-3, atol=1e-4)


def test_training_mode_gives_about_the_same_answers(batches):
    """It uses the statistics of the batch, which are near those of all batches; without them it is far away."""
    x = batches[0]
    network = exported_network()
    expected = network(x)
    wrong = (exported_network().train()(x) - expected).abs().mean()
    measure(network, batches)
    right = (network.train()(x) - expected).abs().mean()
    assert right < 0.05 * wrong


def test_a_second_pass_changes_nothing(batches):
    network = exported_network()
    measure(network, batches)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    measure(network, batches)
    for name, value in network.state_dict().items():
        torch.testing.assert_close(value, before[name], rtol=1e-3, atol=1e-4)


def test_a_channel_that_never_changes_stays_finite():
    network = nn.Sequential(nn.Conv2d(1, 1, 1), nn.BatchNorm2d(1))
    nn.init.zeros_(network[0].weight)
    measure(network, [torch.rand(2, 1, 4, 4)])
    assert all(torch.isfinite(each).all() for each in network.state_dict().values())
