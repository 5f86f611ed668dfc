"""Rendered patches in a small file."""

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_embedded.network.session import CloseLook
from vm_train.look.labels import OBJECT
from vm_train.look.patch_set import PatchSet
from vm_train.tuning.rendered_patches import RENDERED, read_rendered, write_rendered


def test_patches_come_back_nearly_as_they_were(tmp_path):
    random = np.random.default_rng(0)
    count, size = 1100, 16
    coarse = random.integers(0, 256, (count, 2, 2, 3), dtype=np.uint8)
    patches = PatchSet(
        np.repeat(np.repeat(coarse, 8, axis=1), 8, axis=2),
        random.integers(0, 2, count).astype(np.int8),
        random.normal(size=(count, 3)).astype(np.float32),
        np.zeros(count, dtype=np.int32),
    )
    write_rendered(tmp_path / "some.npz", patches)
    found = read_rendered(tmp_path / "some.npz", size)
    assert (found.labels == patches.labels).all()
    assert (found.pictures == -1).all()
    np.testing.assert_allclose(found.targets, patches.targets, rtol=1e-3, atol=1e-3)
    middle = (slice(None), slice(2, 6), slice(2, 6))
    assert np.abs(found.patches[middle].astype(int) - patches.patches[middle]).mean() < 12.0
    assert read_rendered(tmp_path / "some.npz", 8).patches.shape == (count, 8, 8, 3)


def test_the_network_of_the_package_knows_the_patches_of_the_package():
    look = CloseLook.of(read_model(model_path("ball")))["ball"]
    patches = read_rendered(RENDERED, look.contract.size)
    likely = look.run(patches.patches)[:, 0] > 0.5
    shown = patches.labels == OBJECT
    assert likely[shown].mean() > 0.8
    assert likely[~shown].mean() < 0.02


def test_a_damaged_file_is_named(tmp_path):
    path = tmp_path / "cut.npz"
    path.write_bytes(RENDERED.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"can't read .*cut\.npz"):
        read_rendered(path, 40)
