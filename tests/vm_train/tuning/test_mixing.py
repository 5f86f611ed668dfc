"""A network is mixed with the one before its training until it remembers enough."""

import copy

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_train.look.test_trainer import patch_set, trainer, weights
from vm_export.look_network import LookNetwork, LookShape
from vm_train.look.configuration import LookRecipe
from vm_train.look.labels import OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.look.scores import balanced_loss, logits_of
from vm_train.tuning.mixing import Mixer, Remembered, mixed


@given(st.floats(0.0, 1.0), st.integers(0, 99))
def test_all_weights_are_means(share, seed):
    torch.manual_seed(seed)
    before, after = (LookNetwork(LookShape(16, (2, 3, 4), 5)) for _ in range(2))
    old, new = before.state_dict(), after.state_dict()
    for name, value in mixed(before, after, share).state_dict().items():
        torch.testing.assert_close(value, (1.0 - share) * old[name] + share * new[name])


@pytest.fixture(scope="module")
def networks():
    """A network that knows disks, and the same one after it learned that disks are nothing, and all else is one."""
    made = trainer(recipe=LookRecipe(batch=24, rate=0.02), total=100)
    for _ in range(100):
        made.step()
    before, patches = copy.deepcopy(made.network), patch_set()
    swapped = PatchSet(patches.patches, 1 - patches.labels, patches.targets, patches.pictures)
    wrong = trainer(swapped, LookRecipe(batch=24, rate=0.02), 100)
    wrong.network.load_state_dict(weights(made))
    for _ in range(100):
        wrong.step()
    return before, wrong.network, patches


@pytest.mark.parametrize("forgetting", [0.05, 0.5, 5.0])
def test_what_it_knew_stays_within_the_limit_and_a_larger_share_would_exceed_it(networks, forgetting):
    before, after, patches = networks
    limit = (1.0 + forgetting) * Remembered.of(before, patches).loss
    found = Mixer(before, patches, forgetting).mix(after)
    assert 0.1 <= found.share < 1.0
    assert found.loss == Remembered.of(found.network, patches).loss
    assert found.loss <= limit or found.share == 0.1
    assert Remembered.of(mixed(before, after, found.share + 0.1), patches).loss > limit


def test_more_forgetting_never_means_less_of_the_new(networks):
    before, after, patches = networks
    shares = [Mixer(before, patches, each).mix(after).share for each in np.geomspace(0.01, 1000.0, 8)]
    assert shares == sorted(shares)
    assert shares[-1] > shares[0]


def test_what_forgets_nothing_keeps_its_probabilities(networks):
    before, _, patches = networks
    found = Mixer(before, patches, 0.0).mix(before)
    assert found.share == 1.0
    assert found.network.calibration.tolist() == pytest.approx([1.0, 0.0])
    logits = logits_of(before, patches.patches)[:, 0].astype(np.float64)
    assert found.loss_of(patches) == pytest.approx(balanced_loss(logits, patches.labels == OBJECT))
    assert np.isnan(found.loss_of(patches.part(patches.labels == OBJECT)))


@given(st.floats(0.3, 3.0), st.floats(-2.0, 2.0))
def test_probabilities_of_old_patches_keep_their_meaning(networks, scale, offset):
    """A network whose logits are those before, stretched and moved, gets the same probabilities as before."""
    before, _, patches = networks
    after = copy.deepcopy(before)
    with torch.no_grad():
        after.answers.weight[0] *= scale
        after.answers.bias[0] = scale * after.answers.bias[0] + offset
    found = Mixer(before, patches, 0.01).mix(after)
    shown = torch.from_numpy(patches.patches)
    with torch.no_grad():
        torch.testing.assert_close(found.network(shown)[:, 0], before(shown)[:, 0], atol=2e-3, rtol=0.0)
