"""A network that learns from the answers of another one."""

import copy

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from vm_train.look.configuration import LookRecipe, PatchAugmentation
from vm_train.look.labels import OBJECT
from vm_train.look.scores import logits_of
from vm_train.look.teacher import LookTeacher
from vm_train.look.trainer import LookTrainer

from .test_trainer import TWO, patch_set, swapped, trainer


@given(st.lists(st.sampled_from([0.0, 0.25, 1.0]), min_size=12, max_size=12), st.integers(0, 99))
def test_a_target_is_between_the_label_and_the_answer_of_the_teacher(shares, seed):
    network, patches = trainer(shape=TWO).network, torch.from_numpy(patch_set(12).patches).float()
    chosen = torch.from_numpy(np.random.default_rng(seed).permutation(12))
    shown = (chosen % 3 == 0).float()
    kinds = torch.from_numpy(np.random.default_rng(seed + 1).integers(0, 2, 12))
    wanted = LookTeacher(network, torch.tensor(shares)).presence(chosen, patches[chosen], kinds, shown)
    with torch.no_grad():
        answers = network(patches[chosen])[torch.arange(12), kinds, 0]
    part = torch.tensor(shares)[chosen]
    torch.testing.assert_close(wanted, part * answers + (1.0 - part) * shown)


@pytest.mark.long
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_patches_with_a_teacher_keep_their_answers_whatever_their_labels_say(share):
    first = trainer(recipe=LookRecipe(batch=24, rate=0.02), total=150)
    for _ in range(150):
        first.step()
    patches = patch_set()
    teacher = LookTeacher(copy.deepcopy(first.network), torch.full((len(patches),), share))
    recipe = LookRecipe(batch=24, rate=0.02)
    second = LookTrainer(first.network, swapped(patches), 1.75, recipe, PatchAugmentation(), 150, teacher=teacher)
    for _ in range(150):
        second.step()
    right = (logits_of(second.network.eval(), patches)[:, 0] > 0) == (patches.labels == OBJECT)
    assert right.mean() > 0.95 if share else right.mean() < 0.3
