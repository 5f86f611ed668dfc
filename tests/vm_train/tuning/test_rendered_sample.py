"""The sample of a training's patches, for a fine-tuning."""

import numpy as np
import pytest

from vm_embedded.config.sections import read_sections
from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_train.data.split import Split
from vm_train.look.configuration import LookConfiguration
from vm_train.look.labels import NOTHING, OBJECT
from vm_train.look.patch_set import PatchChunk, PatchSet
from vm_train.look.run import begin_look_run
from vm_train.tuning.rendered_patches import read_rendered
from vm_train.tuning.run import check_rendered, write_rendered_for, write_sample

SIZE, NAMES = 8, ("ball", "goal", "robot")
NUMBERS = tuple(f"{number:04d}" for number in range(10))
VALIDATES = 240
"""Gray of a patch for validation."""


def gray_of(kinds, labels):
    """Grays of patches that tell what they are about."""
    return 20 + 60 * kinds + 30 * labels


def begin(folder, counts):
    """A training of a look at three classes with so many plain patches in each of its files."""
    configuration = read_sections(LookConfiguration, None, {"patches": {"size": SIZE}})
    split = Split(NUMBERS[2:], NUMBERS[:2], ())
    run = begin_look_run(folder, folder, split, configuration, model_path("soccer"), "soccer")
    for number, count in enumerate(counts):
        random, patches = np.random.default_rng(number), PatchSet.empty(SIZE, count)
        patches.labels[:] = random.choice([OBJECT, NOTHING], count)
        patches.kinds[:] = random.integers(0, 3, count)
        patches.pictures[:] = random.integers(0, len(NUMBERS), count)
        validates = np.isin(run.numbers, run.split.validation)[patches.pictures]
        gray = np.where(validates, VALIDATES, gray_of(patches.kinds.astype(int), patches.labels))
        patches.patches[:] = gray[:, None, None, None]
        PatchChunk(patches, np.zeros((3, 2), dtype=np.int64)).save(run.patches / f"{number:05d}.npz")
    return run.folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return begin(tmp_path_factory.mktemp("sample") / "run", (16000, 16000))


def test_a_sample_has_patches_of_each_class_and_most_of_the_first_one(folder, tmp_path):
    write_sample(tmp_path / "sample.npz", folder)
    found = read_rendered(tmp_path / "sample.npz", SIZE, NAMES)
    counts = [[int(((found.kinds == kind) & (found.labels == label)).sum()) for label in (1, 0)] for kind in range(3)]
    assert counts == [[1600, 2400], [400, 600], [400, 600]]
    grays = found.patches.mean(axis=(1, 2, 3))
    assert np.abs(grays - gray_of(found.kinds.astype(int), found.labels)).max() < 8.0


def test_a_sample_of_few_patches_is_all_that_are_for_training(tmp_path):
    folder = begin(tmp_path / "run", (70, 30))
    write_sample(tmp_path / "sample.npz", folder)
    chunks = [PatchChunk.load(path).patches for path in sorted((folder / "patches").iterdir())]
    expected = sum(int((each.patches[:, 0, 0, 0] < VALIDATES).sum()) for each in chunks)
    assert len(read_rendered(tmp_path / "sample.npz", SIZE, NAMES)) == expected


def test_a_sample_is_always_the_same(folder, tmp_path):
    for name in ("first.npz", "second.npz"):
        write_sample(tmp_path / name, folder)
    write_rendered_for(tmp_path / "third.npz", folder)
    first, *others = ((tmp_path / f"{name}.npz").read_bytes() for name in ("first", "second", "third"))
    assert others == [first] * 2


def test_a_training_without_patches_or_without_the_class_is_refused(folder, tmp_path):
    for name in NAMES:
        check_rendered(name, folder)
    with pytest.raises(InputError, match=r"is the training of a look at ball, goal, robot, not at 'cup'"):
        check_rendered("cup", folder)
    with pytest.raises(InputError, match=str(tmp_path)):
        write_sample(tmp_path / "sample.npz", begin(tmp_path / "run", ()))


def test_the_package_has_patches_of_its_classes():
    for name in NAMES:
        check_rendered(name, None)
    with pytest.raises(InputError, match=r"has rendered patches of ball, goal, robot, but the close look judges 'cup'"):
        check_rendered("cup", None)
