"""Scores of a look network, and the calibration of its probability."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.looks import random_patches
from vm_export.look_network import LookNetwork, LookShape
from vm_train.look.labels import NOTHING, OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.look.scores import LookScore, logits_of, result_in_words, result_values
from vm_train.look.validation import shown_before
from vm_train.scores.calibration import BINS, Calibration, Reliability
from vm_train.scores.object_ranking import Ranking

flags = st.lists(st.booleans(), min_size=1, max_size=40)


def answers(count, seed=0, scale=1.0, offset=0.0):
    """Logits, and flags that are right with the probability of scale * logit + offset."""
    random = np.random.default_rng(seed)
    logits = random.normal(0.0, 3.0, count)
    return logits, random.random(count) < 1.0 / (1.0 + np.exp(-(scale * logits + offset)))


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (0.5, -2.0), (2.0, 1.0)])
def test_the_calibration_of_many_answers_is_found(scale, offset):
    found = Calibration.fit(*answers(100_000, 1, scale, offset))
    assert (found.scale, found.offset) == pytest.approx((scale, offset), abs=0.05)


def test_calibrated_probabilities_are_right_as_often_as_they_say():
    logits, right = answers(100_000, 2, 0.4, -1.0)
    before = Reliability.of(Calibration().probabilities(logits), right).error
    after = Reliability.of(Calibration.fit(logits, right).probabilities(logits), right).error
    assert after < 0.01 < 0.1 < before


@given(flags, st.integers(0, 2**32))
def test_a_calibration_is_finite_and_keeps_the_order_whatever_it_is_fitted_to(right, seed):
    logits = np.random.default_rng(seed).normal(0.0, 30.0, len(right))
    found = Calibration.fit(logits, np.array(right))
    assert found.scale > 0.0
    assert math.isfinite(found.scale + found.offset)
    probabilities = found.probabilities(np.sort(logits))
    assert ((probabilities >= 0.0) & (probabilities <= 1.0)).all()
    assert (np.diff(probabilities) >= 0.0).all()


def test_answers_without_a_mistake_do_not_get_an_infinite_scale():
    found = Calibration.fit(np.array([-2.0, -1.0, 1.0, 2.0]), np.array([False, False, True, True]))
    assert 0.5 < found.scale < 5.0


def test_errors_are_medians_over_patches_with_an_object():
    patches = PatchSet.empty(16, 4)
    patches.labels[:] = [OBJECT, OBJECT, OBJECT, NOTHING]
    patches.targets[:3, 0] = 0.1
    logits = np.zeros((4, 4), dtype=np.float32)
    logits[:, 0] = [3.0, 2.0, 1.0, 0.0]
    logits[:, 1] = [0.1, 0.4, 0.3, 9.0]
    logits[:, 3] = [0.1, -0.1, 0.1, 9.0]
    found = LookScore.of(logits, patches)
    assert (found.average_precision, found.center_error, found.size_error) == pytest.approx((1.0, 0.2, 0.1))


def test_the_answers_to_a_patch_are_those_about_its_class():
    patches = random_patches(2100, 16)
    network = LookNetwork(LookShape(16, (2, 3, 4), 5, classes=3)).eval()
    kinds = np.arange(2100, dtype=np.int8) % 3
    none = PatchSet.empty(16, 2100)
    found = logits_of(network, replace(none, patches=patches, kinds=kinds))
    with torch.no_grad():
        expected = network.logits(torch.from_numpy(patches)).numpy()
    np.testing.assert_allclose(found, expected[np.arange(2100), kinds], atol=1e-5)
    assert logits_of(network, PatchSet.empty(16)).shape == (0, 4)


def test_the_result_counts_what_is_reported_and_what_is_missed():
    logits, right = np.array([4.0, 3.0, 2.0, -4.0]), np.array([True, False, True, False])
    found = Ranking(confidence=Calibration().probabilities(logits), right=right, truths=4, pictures=3)
    values = result_values(found, Calibration())
    assert values["at_probability_0.5"] == {"hits": 2, "false": 1}
    assert values["average_precision"] == pytest.approx((1.0 + 2 / 3) / 4)
    assert "finds 2 of 4 visible objects" in result_in_words(found)
    assert len(values["bins"]) == BINS
    assert values["bins"][7] == {"from": 0.4667, "to": 0.5333, "count": 0, "confidence": None, "right": None}
    assert result_values(Ranking.empty(), Calibration())["average_precision"] is None


@given(st.lists(st.integers(-1, 4), max_size=12))
def test_of_several_places_of_an_object_only_the_first_counts(objects):
    counted = np.array(objects, dtype=np.int64)[~shown_before(np.array(objects, dtype=np.int64))].tolist()
    assert [each for each in counted if each >= 0] == list(dict.fromkeys(each for each in objects if each >= 0))
    assert counted.count(-1) == objects.count(-1)
