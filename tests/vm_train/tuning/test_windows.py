"""Windows in pictures without lens and pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.looks import look_contract
from vm_embedded.detection.pyramid import Pyramid
from vm_train.look.labels import NOTHING, OBJECT, UNLABELED
from vm_train.tuning.candidates import ClassLook, find_candidates, search_radii, seen_objects
from vm_train.tuning.windows import Windows, grid_windows, jittered_windows, random_windows

CONTRACT = look_contract(size=16, extent=2.0)


def windows(*rows):
    values = np.array(rows, dtype=float).reshape(-1, 3)
    return Windows(values[:, :2], values[:, 2])


class Bright:
    """Judges a patch by its bright pixels, as a look network would: probability, shift and size of a ball, and nothing
    of a cup."""

    contract = look_contract("cup", "ball", size=32, extent=2.0)

    def run(self, patches):
        bright = patches[..., 0] > 128
        answers = np.zeros((len(patches), 2, 4), dtype=np.float32)
        steps = (np.arange(32) + 0.5) / 32 * 4.0 - 2.0
        for number, each in enumerate(bright):
            count = each.sum()
            if 60 < count < 500:
                answers[number, 1] = [
                    0.9 - 0.0002 * abs(int(count) - 201),
                    (each.sum(axis=0) * steps).sum() / count,
                    (each.sum(axis=1) * steps).sum() / count,
                    0.5 * np.log(count / 201.0),
                ]
        return answers


BRIGHT = ClassLook(Bright(), "ball")


def disks(*rows, size=(200, 150)):
    """A black picture with bright disks."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    image = np.zeros((size[1], size[0], 3), dtype=np.uint8)
    for cx, cy, radius in rows:
        image[np.hypot(x - cx, y - cy) <= radius] = 255
    return Pyramid(image, "bgr")


def test_a_patch_shows_the_picture_around_its_window():
    image = np.zeros((60, 80, 3), dtype=np.uint8)
    image[..., 0] = np.arange(80)  # blue is x, green is y
    image[..., 1] = np.arange(60)[:, None]
    patch = windows((40.0, 30.0, 4.0)).cut(Pyramid(image, "bgr"), CONTRACT)[0]
    # 16 samples across 16 px: they are in the middle of each pixel's width from 32 to 48
    np.testing.assert_allclose(patch[0, :, 2], np.arange(32.5, 48.0), atol=0.51)
    np.testing.assert_allclose(patch[:, 0, 1], np.arange(22.5, 38.0), atol=0.51)


def test_more_windows_than_opencv_takes_at_once():
    many = grid_windows((400, 300), np.array([4.0]))
    assert len(many) > 32768 // 16
    assert many.cut(disks((50, 50, 10), size=(400, 300)), CONTRACT).shape == (len(many), 16, 16, 3)
    assert Windows.none().cut(disks(), CONTRACT).shape == (0, 16, 16, 3)


def test_labels_follow_the_rules_of_places_on_the_plane():
    ball = windows((100.0, 80.0, 10.0))
    found = windows((103, 76, 10), (111, 80, 10), (100, 80, 14.5), (100, 80, 20), (120, 80, 10)).label(ball)
    assert found.labels.tolist() == [OBJECT, UNLABELED, UNLABELED, NOTHING, NOTHING]
    np.testing.assert_allclose(found.targets[0], [-0.3, 0.4, 0.0], atol=1e-6)
    assert windows((1, 2, 3)).label(Windows.none()).labels.tolist() == [NOTHING]


@given(st.floats(5, 50), st.floats(5, 50), st.floats(4, 40), st.integers(1, 8), st.integers(0, 99))
def test_jittered_windows_always_show_their_object(x, y, radius, count, seed):
    objects = windows((x, y, radius), (300.0, 300.0, 9.0))
    made = jittered_windows(objects, count, 0.6, 0.28, np.random.default_rng(seed))
    assert len(made) == 2 * count
    labels = made.label(objects)
    sizes = np.exp(0.28)
    near = np.hypot(labels.targets[:, 0], labels.targets[:, 1]) <= 0.9 * sizes + 1e-6
    assert near[labels.labels == OBJECT].all()
    assert (labels.labels != NOTHING).all()


@given(st.integers(1, 60), st.floats(3, 30), st.floats(1, 5), st.integers(0, 99))
def test_random_windows_are_in_the_picture(count, low, factor, seed):
    made = random_windows((120, 90), np.array([low, low * factor]), count, np.random.default_rng(seed))
    assert len(made) == count
    assert (made.centers >= -0.5).all()
    assert (made.centers <= (119.5, 89.5)).all()
    assert (made.radii >= low * (1 - 1e-9)).all()
    assert (made.radii <= low * factor * (1 + 1e-9)).all()


@given(st.floats(0, 119), st.floats(0, 89), st.sampled_from([5.0, 8.0, 13.0]))
def test_the_grid_has_a_window_near_every_place(x, y, radius):
    grid = grid_windows((120, 90), np.array([5.0, 8.0, 13.0]))
    same = grid.part(grid.radii == radius)
    assert np.hypot(same.centers[:, 0] - x, same.centers[:, 1] - y).min() <= np.hypot(1.0, 1.0) * radius


@given(st.lists(st.tuples(st.floats(0, 99), st.floats(0, 99), st.floats(2, 20)), min_size=1, max_size=6))
def test_sizes_to_look_for_cover_those_of_the_objects(rows):
    objects = windows(*rows)
    radii = search_radii(objects)
    low, high = np.percentile(objects.radii, [2, 98])
    assert radii[0] == pytest.approx(max(low, 5.0))
    assert radii[-1] == pytest.approx(max(low, high, 5.0))
    assert (radii[1:] / radii[:-1] <= 1.4 + 1e-9).all()


def test_the_network_finds_each_disk_once_wherever_it_is():
    true = windows((40.3, 60.0, 10.0), (150.0, 35.5, 14.0))
    pyramid = disks((40.3, 60.0, 10.0), (150.0, 35.5, 14.0))
    seen, probabilities = seen_objects(pyramid, (200, 150), BRIGHT, np.array([7.0, 10.0, 14.0]), 0.1, 10)
    assert len(seen) == 2
    assert (probabilities > 0.8).all()
    assert (np.diff(probabilities) <= 0.0).all()
    order = np.argsort(seen.centers[:, 0])
    np.testing.assert_allclose(seen.centers[order], true.centers, atol=0.5)
    assert len(find_candidates(pyramid, (200, 150), BRIGHT, np.array([10.0, 14.0]), 0.1, 1)) == 1
    assert len(find_candidates(disks(), (200, 150), BRIGHT, np.array([10.0]), 0.1, 10)) == 0


def test_only_the_class_that_is_sought_counts():
    pyramid, cups = disks((40.3, 60.0, 10.0)), ClassLook(Bright(), "cup")
    assert (cups.name, cups.contract) == ("cup", BRIGHT.contract)
    assert len(find_candidates(pyramid, (200, 150), cups, np.array([10.0]), 0.1, 10)) == 0
    assert BRIGHT.run(np.zeros((3, 32, 32, 3), dtype=np.uint8)).shape == (3, 4)


@pytest.mark.parametrize("radius", [9.0, 10.5, 12.0])
def test_an_object_has_the_size_that_the_network_sees(radius):
    """Not that of the window: the sizes that it looks for are far apart."""
    pyramid = disks((80.0, 60.0, radius))
    seen, _ = seen_objects(pyramid, (200, 150), BRIGHT, np.array([10.0]), 0.1, 10)
    assert seen.radii == pytest.approx([radius], rel=0.06)


def test_beside_an_object_means_neither_in_it_nor_around_it():
    ball = windows((100, 100, 10))
    others = windows((100, 100, 3), (109, 100, 3), (115, 100, 30), (115, 100, 5))
    assert others.beside(ball).tolist() == [False, False, False, True]
    assert others.beside(Windows.none()).all()
