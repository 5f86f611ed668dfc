"""Windows: smaller pictures of the same world."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_train.windows import window_of

from .test_augmentation import LENSES, SIZE, picture

seeds = st.integers(0, 2**32)


@given(st.sampled_from(LENSES), st.floats(0.1, 0.99), seeds)
def test_a_window_shows_what_lies_in_the_same_directions(lens, share, seed):
    whole = picture(lens)
    part = window_of(whole, share, [0], np.random.default_rng(seed))
    rows, columns = part.labels.shape
    assert (rows, columns) == (max(round(share * SIZE[1]), 1), max(round(share * SIZE[0]), 1))
    pixels = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=2).reshape(-1, 2).astype(float)
    rays = part.lens.lens.for_image((columns, rows)).unproject(pixels, (columns, rows))
    seen = np.isfinite(rays).all(axis=1)
    places = np.rint(whole.lens.lens.for_image(SIZE).project(rays[seen], SIZE)).astype(int)
    assert (whole.image[places[:, 1], places[:, 0]] == part.image.reshape(-1, 3)[seen]).all()
    assert (whole.labels[places[:, 1], places[:, 0]] == part.labels.reshape(-1)[seen]).all()
    assert part.lens.orientation is whole.lens.orientation


def test_most_windows_are_put_over_an_object():
    shown = picture()
    shown.labels[:] = 1
    shown.labels[5, 90] = 0
    random = np.random.default_rng(3)
    share = np.mean([(window_of(shown, 0.2, [0], random).labels == 0).any() for _ in range(600)])
    assert share == pytest.approx(0.76, abs=0.06)


def test_the_whole_picture_stays_as_it_is():
    shown = picture()
    assert window_of(shown, 1.0, [0], np.random.default_rng(0)) is shown


def test_windows_are_anywhere():
    shown = picture()
    shown.labels[:] = 1
    random = np.random.default_rng(3)
    corners = np.array([window_of(shown, 0.5, [0], random).image[0, 0] for _ in range(2000)])
    rows, columns = SIZE[1] // 2 + 1, SIZE[0] // 2 + 1
    found = {tuple(each) for each in corners.tolist()}
    assert (
        len(found & {tuple(each) for each in shown.image[:rows, :columns].reshape(-1, 3).tolist()})
        > 0.6 * rows * columns
    )
