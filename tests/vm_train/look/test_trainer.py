"""Training steps are repeatable, also after an interruption, and prefer hard patches in later rounds."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.vm_train.weights import same
from vm_embedded.errors import InputError
from vm_export.look_network import LookNetwork, LookShape
from vm_export.torch_files import load_values, save_values
from vm_train.look.configuration import LookRecipe, PatchAugmentation
from vm_train.look.labels import NOTHING, OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.look.scores import logits_of
from vm_train.look.trainer import LookTrainer

SIZE = 16
SHAPE = LookShape(SIZE, (4, 6, 8), 8)
TWO = replace(SHAPE, classes=2)
RECIPE = LookRecipe(epochs=3, batch=12, rate=0.01)


def patch_set(count=60):
    """Dark patches of a class; each third shows a bright disk, right of the middle or left of it."""
    random = np.random.default_rng(4)
    made = PatchSet.empty(SIZE, count)
    made.patches[:] = random.integers(0, 60, made.patches.shape)
    made.labels[:] = NOTHING
    at = np.arange(SIZE) - 7.5
    for each in range(0, count, 3):
        side = 2.0 if each % 2 else -2.0
        made.patches[each][np.hypot(at[:, None], at - side) < 5.0] = 220
        made.labels[each] = OBJECT
        made.targets[each] = (side / 5.0, 0.0, 0.1)
    return made


def swapped(patches):
    """The same patches with the opposite labels: all that showed an object shows none, and the other way around."""
    return replace(patches, labels=1 - patches.labels)


def as_kind(patches, kind):
    """The same patches about another class."""
    return replace(patches, kinds=np.full_like(patches.kinds, kind))


def of_two_classes():
    """Dark patches: for the first class, those with a disk show an object, for the second one, those without."""
    second = swapped(patch_set())
    second.targets[:] = 0.0
    return PatchSet.joined(SIZE, [patch_set(), as_kind(second, 1)])


def trainer(patches=None, recipe=RECIPE, total=40, shape=SHAPE):
    torch.manual_seed(recipe.seed)
    return LookTrainer(LookNetwork(shape), patches or patch_set(), 1.75, recipe, PatchAugmentation(), total)


def weights(made):
    return {name: value.clone() for name, value in made.network.state_dict().items()}


def test_it_learns_presence_and_place():
    made = trainer(recipe=LookRecipe(batch=24, rate=0.02), total=150)
    steps = [made.step() for _ in range(150)]
    assert steps[-1]["presence"] < 0.3 * steps[0]["presence"]
    patches = patch_set()
    found = logits_of(made.network.eval(), patches)
    shown = patches.labels == OBJECT
    assert ((found[:, 0] > 0) == shown).all()
    assert np.abs(found[shown, 1] - patches.targets[shown, 0]).max() < 0.2


def test_what_is_an_object_of_one_class_may_be_nothing_of_another():
    patches = of_two_classes()
    made = trainer(patches, LookRecipe(batch=48, rate=0.02), 120, replace(TWO, hidden=32))
    for _ in range(120):
        made.step()
    found = logits_of(made.network.eval(), patches)
    shown = patches.labels == OBJECT
    assert ((found[:, 0] > 0) == shown).all()
    first = shown & (patches.kinds == 0)
    assert np.abs(found[first, 1] - patches.targets[first, 0]).max() < 0.2


@pytest.mark.parametrize("kind", [0, 1])
def test_patches_of_a_class_train_its_answers_and_the_layers_that_all_share(kind):
    made = trainer(as_kind(patch_set(), kind), shape=TWO)
    made.step()
    last = made.network.answers
    for gradient in (last.weight.grad, last.bias.grad):
        own, other = gradient[4 * kind : 4 * kind + 4], gradient[4 * (1 - kind) : 4 * (1 - kind) + 4]
        assert own.reshape(4, -1).abs().amax(dim=1).min() > 0.0
        assert not other.any()
    for layer in (*made.network.convolutions, made.network.hidden):
        assert layer.weight.grad.any()


@pytest.mark.parametrize(("graded", "stop"), [(None, 3), (2, 2), (2, 4), (4, 3)])
def test_what_is_interrupted_ends_with_the_same_weights(graded, stop, tmp_path):
    def run(made, until):
        while made.done < until:
            if made.done == graded:
                made.grade()
            made.step()

    whole = trainer()
    run(whole, 8)
    first, second = trainer(), trainer()
    run(first, stop)
    save_values(tmp_path / "state.pt", first.state())
    second.load(load_values(tmp_path / "state.pt", "a state"))
    run(second, 8)
    assert same(weights(second), weights(whole))
    assert not same(weights(first), weights(whole))


def test_graded_patches_are_drawn_by_their_errors():
    """One dark patch in forty has the disk of an object, so the network is wrong about it."""
    patches = patch_set()
    made = trainer(patches, LookRecipe(batch=24, rate=0.02), 200)
    for _ in range(100):
        made.step()
    hard = 1
    patches.patches[hard] = patches.patches[3]
    made.grade()
    assert 0.0 < made._errors.mean() < 0.2
    drawn = np.concatenate([made._draw(np.random.default_rng(each))[0].numpy() for each in range(100)])
    others = drawn[patches.labels[drawn] == NOTHING]
    assert (others == hard).mean() > 4.0 / 40


def test_a_third_of_each_batch_shows_an_object():
    chosen, shown = trainer()._draw(np.random.default_rng(0))
    patches = patch_set()
    assert ((patches.labels[chosen.numpy()] == OBJECT) == shown.numpy()).all()
    assert shown.sum() == 4


@pytest.mark.parametrize("is_graded", [False, True])
@pytest.mark.parametrize("counts", [(60, 60, 60), (9, 60, 240)])
def test_each_class_is_drawn_equally_often_with_and_without_an_object(counts, is_graded):
    """After grading, too, as long as the network is equally wrong about all."""
    patches = PatchSet.joined(SIZE, [as_kind(patch_set(count), kind) for kind, count in enumerate(counts)])
    made = trainer(patches, LookRecipe(batch=90), shape=replace(SHAPE, classes=len(counts)))
    if is_graded:
        torch.nn.init.zeros_(made.network.answers.weight)
        torch.nn.init.zeros_(made.network.answers.bias)
        made.grade()
    drawn = [made._draw(np.random.default_rng(each)) for each in range(100)]
    for shows in (0.0, 1.0):
        kinds = np.concatenate([patches.kinds[chosen[shown == shows].numpy()] for chosen, shown in drawn])
        assert np.bincount(kinds) / len(kinds) == pytest.approx(1.0 / len(counts), abs=0.03)
    hits = np.bincount(np.concatenate([chosen.numpy() for chosen, _ in drawn]), minlength=len(patches))
    assert hits[patches.kinds == 0].min() > 0


def test_given_weights_count_instead_of_the_classes():
    patches = PatchSet.joined(SIZE, [as_kind(patch_set(), kind) for kind in (0, 1)])
    weights = np.where(patches.kinds == 0, 0.0, 1.0)
    made = LookTrainer(LookNetwork(TWO), patches, 1.75, RECIPE, PatchAugmentation(), 40, weights)
    assert patches.kinds[made._draw(np.random.default_rng(0))[0].numpy()].all()


@pytest.mark.parametrize(("label", "what"), [(OBJECT, "shows no object"), (NOTHING, "shows an object")])
def test_patches_of_one_kind_are_refused(label, what):
    patches = patch_set()
    patches.labels[:] = label
    with pytest.raises(InputError, match=f"none of the 60 training patches {what}"):
        trainer(patches)


def test_a_loss_that_is_no_number_ends_the_training():
    made = trainer(recipe=LookRecipe(batch=12, rate=1e3), total=40)
    with torch.no_grad():
        made.network.answers.weight *= torch.inf
    with pytest.raises(InputError, match="is NaN or infinite: begin again with a lower"):
        made.step()


def test_a_state_of_another_training_is_refused():
    made = trainer()
    made.grade()
    with pytest.raises(InputError, match="belongs to another training"):
        trainer(patch_set(30)).load(made.state())
