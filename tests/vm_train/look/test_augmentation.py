"""Augmentation of patches."""

import math
from dataclasses import fields, replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_train.look.augmentation import augment
from vm_train.look.configuration import PatchAugmentation

OFF = replace(
    PatchAugmentation(),
    **{each.name: 0.0 for each in fields(PatchAugmentation) if each.name not in ("blur", "noise")},
)
EXTENT = 2.0
PATCHES = torch.randint(20, 230, (6, 16, 16, 3), generator=torch.Generator().manual_seed(1)).to(torch.uint8)
TARGETS = torch.rand((6, 3), generator=torch.Generator().manual_seed(2)) - 0.5


def augmented(wanted, seed=0, patches=PATCHES):
    return augment(patches, TARGETS[: len(patches)], EXTENT, wanted, torch.Generator().manual_seed(seed))


def test_everything_switched_off_changes_nothing():
    patches, targets = augmented(OFF)
    assert torch.allclose(patches, PATCHES.float(), atol=1e-3)
    assert torch.equal(targets, TARGETS)


def test_a_mirror_image_has_its_object_on_the_other_side():
    patches, targets = augmented(replace(OFF, mirror=1.0))
    assert torch.allclose(patches, PATCHES.flip(2).float(), atol=1e-3)
    assert torch.equal(targets, TARGETS * torch.tensor([-1.0, 1.0, 1.0]))


@pytest.mark.parametrize("name", ["hidden", "gamma", "gain", "gray", "blur_share", "noise_share"])
def test_each_entry_changes_the_patches_and_leaves_the_targets(name):
    patches, targets = augmented(replace(OFF, noise=0.1, **{name: 1.0}))
    assert (patches - PATCHES.float()).abs().amax(dim=(1, 2, 3)).median() > 2.0
    assert torch.equal(targets, TARGETS)


@settings(max_examples=15)
@given(st.integers(0, 2**60))
def test_all_entries_together_stay_within_the_limits_and_depend_on_the_seed_alone(seed):
    shares = {each.name: 1.0 for each in fields(PatchAugmentation) if each.name.endswith("share")}
    everything = PatchAugmentation(mirror=0.5, gray=0.5, gamma=1.0, gain=1.0, **shares)
    patches, targets = augmented(everything, seed)
    assert patches.shape == PATCHES.shape
    assert 0.0 <= patches.min() <= patches.max() <= 255.0
    again, targets_again = augmented(everything, seed)
    assert torch.equal(patches, again)
    assert torch.equal(targets, targets_again)


def test_a_gray_patch_has_no_color():
    patches, _ = augmented(replace(OFF, gray=1.0))
    assert torch.allclose(patches[..., 0], patches[..., 2])


def test_blur_keeps_plain_patches_and_the_mean_and_lowers_the_contrast():
    blurred = replace(OFF, blur_share=1.0, blur=(1.0, 1.0))
    plain = torch.full((2, 16, 16, 3), 90, dtype=torch.uint8)
    assert torch.allclose(augmented(blurred, patches=plain)[0], plain.float(), atol=1e-2)
    patches, _ = augmented(blurred)
    assert patches.mean() == pytest.approx(PATCHES.float().mean().item(), abs=1.0)
    assert patches.std() < 0.5 * PATCHES.float().std()


def test_an_entry_leaves_the_draws_of_the_others():
    bright, _ = augmented(replace(OFF, gain=0.02))
    both, _ = augmented(replace(OFF, gain=0.02, gray=1.0))
    assert torch.allclose(both[..., 0], bright.mean(dim=3), atol=1e-2)


def disk(right, down, radius):
    """A patch with a bright disk at a place [expected radii]; all numbers are those of the patch's middles."""
    at = (torch.arange(64) + 0.5) / 32.0 * EXTENT - EXTENT
    inside = torch.hypot(at[None, :] - right, at[:, None] - down) < radius
    return (200 * inside)[..., None].expand(64, 64, 3).to(torch.uint8)


@given(
    seed=st.integers(0, 2**40),
    name=st.sampled_from(["rotation", "zoom", "shift"]),
    right=st.floats(-0.6, 0.6),
    down=st.floats(-0.6, 0.6),
)
def test_an_object_is_where_its_target_says_after_a_turn_zoom_or_shift(seed, name, right, down):
    wanted = replace(OFF, **{name: {"rotation": 40.0, "zoom": 0.1, "shift": 0.4}[name]})
    target = torch.tensor([[right, down, 0.1]])
    patches, targets = augment(
        disk(right, down, 0.6)[None], target, EXTENT, wanted, torch.Generator().manual_seed(seed)
    )
    at = (torch.arange(64) + 0.5) / 32.0 * EXTENT - EXTENT
    weight = patches[0, ..., 0] / patches[0, ..., 0].sum()
    found = (weight.sum(dim=0) @ at).item(), (weight.sum(dim=1) @ at).item()
    assert found == pytest.approx(targets[0, :2].tolist(), abs=0.03)
    area = (patches[0, ..., 0].sum() / 200.0 / 32.0**2 * EXTENT**2).item()
    assert area == pytest.approx(math.pi * (0.6 * math.exp(targets[0, 2].item() - 0.1)) ** 2, rel=0.03)


def test_a_hidden_rectangle_has_one_color_and_leaves_the_rest():
    patches, _ = augmented(replace(OFF, hidden=1.0))
    changed = ((patches - PATCHES.float()).abs() > 1e-3).any(dim=3)
    for patch, mask in zip(patches, changed, strict=True):
        rows, columns = mask.any(dim=1).nonzero()[:, 0], mask.any(dim=0).nonzero()[:, 0]
        inside = patch[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        assert torch.allclose(inside, inside[0, 0].expand_as(inside), atol=1e-3)
        assert 1 <= len(rows) <= 0.5 * 16
        assert 1 <= len(columns) <= 0.5 * 16
