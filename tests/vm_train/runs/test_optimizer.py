"""Weights follow their gradients in the ways that recipes name."""

import pytest
import torch
from torch import nn

from vm_train.runs.configuration import OPTIMIZERS
from vm_train.runs.optimizer import ScheduledOptimizer

RATE = 0.02


def layer(seed=1):
    torch.manual_seed(seed)
    made = nn.Linear(28, 4)
    made.weight.grad, made.bias.grad = torch.randn(4, 28) * torch.tensor([[1.0], [1e-3], [30.0], [0.2]]), torch.randn(4)
    return made


def descent(made, optimizer, schedule="constant"):
    return ScheduledOptimizer(made, optimizer, RATE, 0.0, 10, schedule)


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_every_weight_goes_against_its_gradient(optimizer):
    made = layer()
    before, gradient = made.bias.detach().clone(), made.bias.grad.clone()
    matrix, slope = made.weight.detach().clone(), made.weight.grad.clone()
    descent(made, optimizer).step()
    assert (((made.bias.detach() - before) * gradient) < 0.0).all()
    assert ((made.weight.detach() - matrix) * slope).sum() < 0.0


def test_with_muon_weak_and_strong_channels_learn_alike():
    made = layer()
    before = made.weight.detach().clone()
    descent(made, "muon").step()
    singular = torch.linalg.svdvals((made.weight.detach() - before) / RATE)
    assert singular.max() < 1.3  # what five steps of Newton and Schulz leave of the gradient's, 30 to 0.001
    assert (singular > 0.5).sum() >= 3


def test_muon_sees_a_kernel_as_a_matrix_with_a_row_for_each_output_channel():
    torch.manual_seed(0)
    convolution, matrix = nn.Conv2d(3, 4, 3), nn.Linear(27, 4)
    with torch.no_grad():
        matrix.weight.copy_(convolution.weight.flatten(1))
        matrix.bias.copy_(convolution.bias)
    descents = [descent(each, "muon") for each in (convolution, matrix)]
    patches = torch.randn(6, 3, 3, 3)
    for _ in range(3):
        for each in descents:
            each.zero_grad()
        convolution(patches).flatten(1).square().sum().backward()
        matrix(patches.flatten(1)).square().sum().backward()
        for each in descents:
            each.step()
    torch.testing.assert_close(convolution.weight.flatten(1), matrix.weight)
    torch.testing.assert_close(convolution.bias, matrix.bias)


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_a_rate_of_zero_moves_nothing(optimizer):
    made = layer()
    before = {name: value.clone() for name, value in made.state_dict().items()}
    following = descent(made, optimizer)
    following.rate = 0.0
    following.step()
    assert following.rate == 0.0
    assert all(torch.equal(before[name], value) for name, value in made.state_dict().items())


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_one_cycle_goes_up_to_the_rate_and_down(optimizer):
    made = layer()
    following = descent(made, optimizer, "one_cycle")
    rates = []
    for _ in range(10):
        rates.append(following.rate)
        following.step()
    top = rates.index(max(rates))
    assert 0 < top < 9
    assert max(rates) == pytest.approx(RATE, rel=0.05)
    assert rates[:top] == sorted(rates[:top])
    assert rates[top:] == sorted(rates[top:], reverse=True)
    assert rates[-1] < 0.001 * RATE


@pytest.mark.parametrize("made", [layer(), nn.Conv2d(3, 4, 3)])
def test_forgotten_gradients_are_none(made):
    following = descent(made, "muon")
    made.weight.grad, made.bias.grad = torch.ones_like(made.weight), torch.ones_like(made.bias)
    following.zero_grad()
    assert made.weight.grad is None
    assert made.bias.grad is None


def test_a_state_of_another_optimizer_is_refused():
    muon, adam = descent(layer(), "muon"), descent(layer(), "adamw")
    with pytest.raises((ValueError, KeyError, TypeError)):
        muon.load_state_dict(adam.state_dict())
