"""Tables hold the spot that they are drawn for, and their textures repeat."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_synth.scene.rooms import HELD_OUT_ROOMS, ROOMS, furnish_room
from vm_synth.scene.surface import TableRanges, draw_surface
from vm_synth.scene.textures import KINDS, draw_texture, read_textures

seeds = st.integers(0, 2**32 - 1)
spots = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
GRAY = (np.full((8, 8, 3), 0.3, dtype=np.float32),)


def drawn(seed, spot, table=True, textures=GRAY):
    return draw_surface(np.random.default_rng(seed), TableRanges(), table, textures, np.array(spot))


@given(seed=seeds, spot=spots)
def test_a_table_is_below_the_spot_and_ends(seed, spot):
    table = drawn(seed, spot)
    assert table.is_table
    assert table.on_carpet(np.array(spot), 0.0)
    assert table.on_carpet(np.array(table.middle), 0.45 * table.width / 2.0)
    assert not table.on_carpet(np.array(table.middle) + 3.0 * table.length, 0.0)


@given(seed=seeds, spot=spots, points=st.lists(spots, min_size=2, max_size=2))
def test_the_frame_of_a_table_keeps_distances(seed, spot, points):
    first, second = table_points = drawn(seed, spot).local(np.array(points))
    assert table_points.shape == (2, 2)
    assert np.linalg.norm(first - second) == pytest.approx(math.dist(*points), abs=1e-6)


@given(seed=seeds, spot=spots)
def test_a_floor_is_everywhere(seed, spot):
    floor = drawn(seed, spot, table=False)
    assert not floor.is_table
    assert not floor.round
    assert floor.on_carpet(np.array([1e3, -1e3]), 10.0)


@given(seed=seeds)
def test_textures_are_albedo(seed):
    texture = draw_texture(np.random.default_rng(seed))
    assert texture.shape == (512, 512, 3)
    assert texture.dtype == np.float32
    assert 0.0 < texture.min() <= texture.max() < 1.0


@pytest.mark.long
def test_all_kinds_of_textures_are_drawn():
    spread = [draw_texture(np.random.default_rng(seed)).std(axis=(0, 1)).max() for seed in range(30)]
    assert min(spread) < 0.02 < max(spread)
    assert len(KINDS) > 5


def test_pictures_of_a_folder_are_textures_in_the_order_of_their_names(tmp_path):
    for name, color in (("b.png", (0, 0, 255)), ("a.jpg", (255, 255, 255))):
        cv2.imwrite(str(tmp_path / name), np.full((30, 50, 3), color, dtype=np.uint8))
    (tmp_path / "note.txt").write_text("not a picture")
    white, red = read_textures(tmp_path)
    assert white.mean() > 0.9
    assert red.mean(axis=(0, 1)) == pytest.approx([0.95, 0.01, 0.01], abs=0.02)


def test_folders_without_textures_and_damaged_ones_are_named(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        read_textures(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no pictures"):
        read_textures(tmp_path)
    (tmp_path / "oak.jpg").write_bytes(b"")
    with pytest.raises(InputError, match=r"oak\.jpg can't be read"):
        read_textures(tmp_path)


def test_rooms_repeat_differ_and_give_light():
    rooms = [furnish_room(number) for number in (*ROOMS[:3], *HELD_OUT_ROOMS[:2])]
    assert len({each.name for each in rooms}) == len(rooms)
    assert (furnish_room(ROOMS[1]).radiance == rooms[1].radiance).all()
    for each in rooms:
        height, width = each.radiance.shape[:2]
        assert width == 2 * height
        assert each.radiance.min() > 0.0
        assert (each.irradiance > 0.01).all()
    assert not set(ROOMS) & set(HELD_OUT_ROOMS)
