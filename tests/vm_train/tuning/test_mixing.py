"""A network is mixed with the one before its training until it remembers enough."""

import copy

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_train.look.test_trainer import SIZE, TWO, as_kind, patch_set, swapped, trainer, weights
from vm_export.look_network import LookNetwork, LookShape
from vm_train.look.configuration import LookRecipe
from vm_train.look.labels import OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.look.scores import balanced_loss, logits_of
from vm_train.tuning.mixing import Mixer, Mixture, Remembered, mixed


@given(st.floats(0.0, 1.0), st.integers(0, 99))
def test_all_weights_are_means(share, seed):
    torch.manual_seed(seed)
    before, after = (LookNetwork(LookShape(16, (2, 3, 4), 5, 2)) for _ in range(2))
    old, new = before.state_dict(), after.state_dict()
    for name, value in mixed(before, after, share).state_dict().items():
        torch.testing.assert_close(value, (1.0 - share) * old[name] + share * new[name])


RECIPE = LookRecipe(batch=24, rate=0.02)


def trained(patches, start=None, shape=None):
    """A network after 100 steps on patches. start: the training whose weights it begins with."""
    made = trainer(patches, RECIPE, 100) if shape is None else trainer(patches, RECIPE, 100, shape)
    if start is not None:
        made.network.load_state_dict(weights(start))
    for _ in range(100):
        made.step()
    return made


@pytest.fixture(scope="module")
def networks():
    """A network that knows disks, and the same one after it learned that disks are nothing, and all else is one."""
    made, patches = trained(patch_set()), patch_set()
    before = copy.deepcopy(made.network)
    return before, trained(swapped(patches), made).network, patches


@pytest.fixture(scope="module")
def two():
    """A network that knows disks as objects of two classes, and the same one after it learned the opposite about one of
    them, and their patches."""
    patches = PatchSet.joined(SIZE, [as_kind(patch_set(), kind) for kind in (0, 1)])
    made = trained(patches, shape=TWO)
    before = copy.deepcopy(made.network)
    learned = PatchSet.joined(SIZE, [patch_set(), as_kind(swapped(patch_set()), 1)])
    return before, trained(learned, made, TWO).network, patches


@pytest.mark.parametrize("forgetting", [0.05, 0.5, 5.0])
def test_what_it_knew_stays_within_the_limit_and_a_larger_share_would_exceed_it(networks, forgetting):
    before, after, patches = networks
    limit = (1.0 + forgetting) * loss_of(before, patches)
    found = Mixer(before, patches, forgetting).mix(after)
    assert 0.1 <= found.share < 1.0
    assert found.loss == loss_of(found.network, patches)
    assert found.loss <= limit or found.share == 0.1
    assert loss_of(mixed(before, after, found.share + 0.1), patches) > limit


def loss_of(network, patches):
    """The loss of the only class of a network."""
    (loss,) = Remembered.of(network, patches).losses
    return loss


@pytest.mark.parametrize("forgetting", [0.5, 5.0])
def test_no_class_is_forgotten_because_another_one_is_known(two, forgetting):
    before, after, patches = two
    limits = [(1.0 + forgetting) * each for each in Remembered.of(before, patches).losses]
    found = Mixer(before, patches, forgetting).mix(after)
    assert 0.1 <= found.share < 1.0
    losses = Remembered.of(found.network, patches).losses
    assert found.loss == pytest.approx(np.mean(losses))
    assert found.share == 0.1 or all(each <= limit for each, limit in zip(losses, limits, strict=True))
    more = Remembered.of(mixed(before, after, found.share + 0.1), patches).losses
    assert any(each > limit for each, limit in zip(more, limits, strict=True))
    alone = Mixer(before, patches.part(patches.kinds == 0), forgetting).mix(after)
    assert alone.share > found.share


def test_a_class_without_old_patches_has_no_limit_and_keeps_its_calibration(two):
    before, after, patches = two
    first = patches.part(patches.kinds == 0)
    remembered = Remembered.of(before, first)
    assert np.isnan(remembered.losses).tolist() == [False, True]
    found = Mixer(before, first, 0.5).mix(after)
    assert found.loss == pytest.approx(Remembered.of(found.network, first).losses[0])
    assert found.network.calibration[1].tolist() == [1.0, 0.0]


def test_more_forgetting_never_means_less_of_the_new(networks):
    before, after, patches = networks
    shares = [Mixer(before, patches, each).mix(after).share for each in np.geomspace(0.01, 1000.0, 8)]
    assert shares == sorted(shares)
    assert shares[-1] > shares[0]


def test_what_forgets_nothing_keeps_its_probabilities(networks):
    before, _, patches = networks
    found = Mixer(before, patches, 0.0).mix(before)
    assert found.share == 1.0
    assert found.network.calibration.flatten().tolist() == pytest.approx([1.0, 0.0])
    logits = logits_of(before, patches)[:, 0].astype(np.float64)
    assert found.loss_of(patches, 0) == pytest.approx(balanced_loss(logits, patches.labels == OBJECT))
    assert np.isnan(found.loss_of(patches.part(patches.labels == OBJECT), 0))


def test_the_loss_of_a_class_has_the_calibration_of_that_class(two):
    before, _, patches = two
    network = copy.deepcopy(before)
    network.calibration.copy_(torch.tensor([[1.0, 0.0], [0.5, 2.0]]))
    found, own = Mixture(network, 1.0, 0.0), patches.part(patches.kinds == 1)
    logits = logits_of(network, own)[:, 0].astype(np.float64)
    assert found.loss_of(own, 1) == pytest.approx(balanced_loss(0.5 * logits + 2.0, own.labels == OBJECT))


@given(st.floats(0.3, 3.0), st.floats(-2.0, 2.0))
def test_probabilities_of_old_patches_keep_their_meaning(networks, scale, offset):
    """A network whose logits are those before, stretched and moved, gets the same probabilities as before."""
    before, _, patches = networks
    after = stretched(before, {0: (scale, offset)})
    found = Mixer(before, patches, 0.01).mix(after)
    shown = torch.from_numpy(patches.patches)
    with torch.no_grad():
        torch.testing.assert_close(found.network(shown)[..., 0], before(shown)[..., 0], atol=2e-3, rtol=0.0)


@given(*(st.tuples(st.floats(0.3, 3.0), st.floats(-2.0, 2.0)) for _ in range(2)))
def test_the_probabilities_of_each_class_keep_their_meaning(two, first, second):
    before, _, patches = two
    found = Mixer(before, patches, 0.01).mix(stretched(before, {0: first, 1: second}))
    shown = torch.from_numpy(patches.patches)
    with torch.no_grad():
        torch.testing.assert_close(found.network(shown)[..., 0], before(shown)[..., 0], atol=2e-3, rtol=0.0)


def stretched(network, changes):
    """The same network with other logits of some classes: times a scale, plus an offset."""
    made = copy.deepcopy(network)
    with torch.no_grad():
        for kind, (scale, offset) in changes.items():
            made.answers.weight[4 * kind] *= scale
            made.answers.bias[4 * kind] = scale * made.answers.bias[4 * kind] + offset
    return made
