"""Rendered patches in a small file."""

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook
from vm_train.look.labels import OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.tuning.rendered_patches import RENDERED, read_rendered, rendered_names, write_rendered

COUNT, SIZE, NAMES = 1100, 16, ("ball", "goal", "robot")


@pytest.fixture(scope="module")
def patches():
    """Patches of four plain squares, about three classes."""
    random = np.random.default_rng(0)
    coarse = random.integers(0, 256, (COUNT, 2, 2, 3), dtype=np.uint8)
    return PatchSet(
        np.repeat(np.repeat(coarse, 8, axis=1), 8, axis=2),
        random.integers(0, 2, COUNT).astype(np.int8),
        random.normal(size=(COUNT, 3)).astype(np.float32),
        random.integers(0, 3, COUNT).astype(np.int8),
        np.zeros(COUNT, dtype=np.int32),
    )


@pytest.fixture(scope="module")
def written(patches, tmp_path_factory):
    """A file of these patches."""
    path = tmp_path_factory.mktemp("rendered") / "some.npz"
    write_rendered(path, patches, NAMES)
    return path


def assert_nearly_the_same(found, patches):
    assert (found.labels == patches.labels).all()
    assert (found.pictures == -1).all()
    np.testing.assert_allclose(found.targets, patches.targets, rtol=1e-3, atol=1e-3)
    middle = (slice(None), slice(2, 6), slice(2, 6))
    assert np.abs(found.patches[middle].astype(int) - patches.patches[middle]).mean() < 12.0


def test_patches_come_back_nearly_as_they_were(patches, written):
    found = read_rendered(written, SIZE, NAMES)
    assert_nearly_the_same(found, patches)
    assert (found.kinds == patches.kinds).all()
    assert read_rendered(written, 8, NAMES).patches.shape == (COUNT, 8, 8, 3)
    assert rendered_names(written) == NAMES


@pytest.mark.parametrize("names", [("robot", "ball"), ("cup", "goal"), ("cup",)])
def test_a_look_gets_the_patches_of_its_classes_with_their_numbers_in_its_order(names, patches, written):
    found = read_rendered(written, SIZE, names)
    expected = patches.part(np.isin(patches.kinds, [NAMES.index(each) for each in names if each in NAMES]))
    assert len(found) == len(expected)
    assert [names[each] for each in found.kinds] == [NAMES[each] for each in expected.kinds]
    if len(found):
        assert_nearly_the_same(found, expected)


def test_the_network_of_the_package_knows_the_patches_of_the_package():
    look = CloseLook.of(read_model(model_path("soccer")))
    names = look.contract.names
    patches = read_rendered(RENDERED, look.contract.size, names)
    likely = look.run(patches.patches)[np.arange(len(patches)), patches.kinds, 0] > 0.5
    for kind, name in enumerate(names):
        shown = (patches.labels == OBJECT)[patches.kinds == kind]
        of_class = likely[patches.kinds == kind]
        assert of_class[shown].mean() > (0.8 if name == "ball" else 0.6), name
        assert of_class[~shown].mean() < (0.02 if name == "ball" else 0.1), name


def test_a_damaged_file_is_named(tmp_path):
    path = tmp_path / "cut.npz"
    path.write_bytes(RENDERED.read_bytes()[:5000])
    for read in (rendered_names, lambda path: read_rendered(path, 40, NAMES)):
        with pytest.raises(InputError, match=r"can't read .*cut\.npz"):
            read(path)


def test_a_file_of_an_earlier_release_is_refused(written, tmp_path):
    path = tmp_path / "old.npz"
    with np.load(written) as file:
        np.savez(path, **{name: file[name] for name in file.files if name not in ("names", "kinds")})
    for read in (rendered_names, lambda path: read_rendered(path, SIZE, NAMES)):
        with pytest.raises(InputError, match=r"can't read .*old\.npz: .*names"):
            read(path)
