"""The layout canvas: strips stand apart, each point has one place, and a bucket moves strips without changing them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.footprint import BLOCK as POINTS
from vm_embedded.detection.footprint import levels_for
from vm_embedded.detection.projection import project
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import build_mesh, mesh_model
from vm_embedded.mesh.octaves import BLOCK, GAP
from vm_embedded.network.canvas_layout import SMALLEST, CanvasLayout, pack
from vm_embedded.network.choose_layout import choose_layout

from ..strategies import SIZE, reals, seeds

MANIFEST = ball_manifest(
    "ball", "line", "other", mesh="octaves", layout="canvas", sampling="footprint", intersections=1.5, max_distance=4.0
)
MESH = build_mesh(Sphere(0.1), 0.7, 1.5, 4.0, "octaves")
STEPS = mesh_model("octaves").steps

boxes = st.lists(st.tuples(st.integers(1, 60), st.integers(1, 300)), max_size=9)


@given(boxes)
def test_boxes_stand_apart_on_whole_blocks(sizes):
    places, shape = pack(sizes)
    assert all(each % BLOCK == 0 for place in [*places, shape] for each in place)
    taken = np.zeros(shape, dtype=int)
    for (row, column), (rows, columns) in zip(places, sizes, strict=True):
        assert row + rows <= shape[0]
        assert column + columns <= shape[1]
        # With its gap a box meets no other one; gaps may meet, and may leave the canvas.
        assert not taken[row : row + rows + GAP, column : column + columns + GAP].any()
        taken[row : row + rows, column : column + columns] += 1
    for (row, column), (rows, columns) in zip(places, sizes, strict=True):
        around = taken[max(row - GAP, 0) : row + rows + GAP, max(column - GAP, 0) : column + columns + GAP]
        assert around.sum() == rows * columns
    assert taken.max(initial=0) <= 1


@given(boxes.filter(bool))
def test_a_canvas_is_not_much_larger_than_its_boxes(sizes):
    """At most twice the boxes in whole blocks, and what stays free beside the largest one and the last shelf."""
    (rows, columns) = pack(sizes)[1]
    area = sum(-(-(r + GAP) // BLOCK) * -(-(c + GAP) // BLOCK) for r, c in sizes) * BLOCK * BLOCK
    widest, tallest = max(c for _, c in sizes) + BLOCK, max(r for r, _ in sizes) + BLOCK
    assert rows * columns <= 2 * area + 2 * widest * tallest


def test_without_boxes_a_canvas_can_still_be_halved_three_times():
    assert pack([]) == ([], (SMALLEST, SMALLEST))
    assert SMALLEST % BLOCK == 0


@st.composite
def parts(draw):
    """A part of the mesh: any points, what a camera sees, or none."""
    kind = draw(st.sampled_from(["any", "seen", "none", "all"]))
    if kind == "all":
        return MESH
    if kind == "none":
        return MESH.part(np.array([], dtype=np.intp))
    if kind == "any":
        return MESH.part(np.flatnonzero(np.random.default_rng(draw(seeds)).random(len(MESH)) < draw(reals(0.0, 1.0))))
    turn = Orientation.from_roll_pitch(0.7, draw(reals(-0.6, 0.6)), draw(reals(-0.2, 1.2))).rotation
    lens = draw(st.sampled_from([Equisolid(focal_length=200.0, fov=2.6), Rectilinear(focal_length=400.0, fov=2.0)]))
    return project(MESH, turn, lens, SIZE).visible.graph


@given(parts())
def test_each_point_of_a_strip_with_core_points_has_one_slot_and_others_none(mesh):
    layout = CanvasLayout(mesh, STEPS)
    rows, columns = layout.shape
    assert len(layout) == rows * columns
    answered = np.unique(mesh.strips[~mesh.margin])
    held = np.flatnonzero(np.isin(mesh.strips, answered))
    np.testing.assert_array_equal(np.sort(layout.slots[layout.slots < len(mesh)]), held)
    assert len(layout.pieces) == len(answered)
    np.testing.assert_array_equal(layout.slots[layout.places], np.flatnonzero(~mesh.margin))
    np.testing.assert_array_equal(np.flatnonzero(layout.original), np.sort(layout.places))
    empty = layout.slots == len(mesh)
    np.testing.assert_array_equal(layout.rays[~empty], mesh.rays[layout.slots[~empty]])
    assert np.isnan(layout.rays[empty]).all()
    np.testing.assert_array_equal(layout.strips[~empty], mesh.strips[layout.slots[~empty]])
    assert (layout.strips[empty] == -1).all()
    assert layout.rays.T.flags.c_contiguous


@given(parts())
def test_a_strip_is_upright_in_its_piece(mesh):
    """A column to the right is a column to the right, a row up is a row up."""
    layout = CanvasLayout(mesh, STEPS)
    slots = layout.slots.reshape(layout.shape)
    for piece, strip in zip(layout.pieces, np.unique(mesh.strips[~mesh.margin]), strict=True):
        inside = slots[piece.region]
        row, column = np.nonzero(inside < len(mesh))
        points = inside[row, column]
        assert (mesh.strips[points] == strip).all()
        assert len(points) == (mesh.strips == strip).sum()
        assert len(np.unique(mesh.cells[points] - np.stack([column, -row], axis=1), axis=0)) == 1


@given(parts())
def test_links_are_those_of_the_mesh_among_the_points_that_are_answered(mesh):
    layout = CanvasLayout(mesh, STEPS)
    core = mesh.part(np.flatnonzero(~mesh.margin))
    found = layout.links(layout.places)
    slot_of = np.append(layout.places, len(layout))
    np.testing.assert_array_equal(found, slot_of[core.neighbors[:-1]])


@given(parts(), seeds)
def test_feeds_are_a_picture_that_is_black_where_nothing_is_shown(mesh, seed):
    layout, random = CanvasLayout(mesh, STEPS), np.random.default_rng(seed)
    shown = (layout.slots < len(mesh)) & (random.random(len(layout)) < 0.7)
    colors = np.where(shown, random.random((3, len(layout)), dtype=np.float32), np.float32(np.nan))
    before = colors.copy()
    feeds = layout.feeds(colors, shown)
    np.testing.assert_array_equal(colors, before)
    assert (feeds["points"].shape, feeds["points"].dtype) == ((1, 3, *layout.shape), np.float32)
    assert (feeds["shown"].shape, feeds["shown"].dtype) == ((1, 1, *layout.shape), bool)
    np.testing.assert_array_equal(feeds["points"].reshape(3, -1)[:, shown], colors[:, shown])
    assert not feeds["points"].reshape(3, -1)[:, ~shown].any()


def test_what_a_canvas_holds_is_read_only_and_counted():
    layout = CanvasLayout(MESH, STEPS)
    arrays = [each for each in vars(layout).values() if isinstance(each, np.ndarray)]
    for array in arrays:
        assert not array.flags.writeable
    assert layout.nbytes == sum(each.nbytes for each in arrays)


def levels_in(levels):
    """How often the picture of each point (n,) is halved."""
    found = np.empty(len(levels.places), dtype=int)
    for level, blocks in levels.shares():
        found[levels.order[blocks.start * POINTS : blocks.stop * POINTS]] = level
    return found


def shown_of(layout, levels, turn, lens):
    """Of each strip with answers on screen, for what is shown: cells, their places in blocks, pixels, levels, and
    whether they are answered."""
    shown, level, found = project(layout, turn, lens, SIZE), levels_in(levels), {}
    for piece in layout.pieces:
        box = np.arange(len(layout)).reshape(layout.shape)[piece.region]
        seen = shown.on_screen[box]
        if (seen & layout.original[box]).any():
            row, column = np.nonzero(seen)
            inside = box[row, column]
            cells = np.stack([column - column.min(), row - row.min()], axis=1)
            within = np.stack([column, row], axis=1) % BLOCK
            answered = layout.original[inside]
            found[int(layout.strips[inside[0]])] = (cells, within, shown.pixels[inside], level[inside], answered)
    return found


@given(reals(-0.5, 0.5), reals(-0.5, 0.5), reals(0.2, 1.0), reals(0.02, 0.4), reals(150.0, 900.0))
def test_a_bucket_shows_each_strip_as_the_whole_mesh_does(roll, pitch, tilt, step, focal_length):
    """The same cells on screen, halved together, from the same places of the same copy of the picture.

    Only where a strip lies on the canvas depends on the bucket. The network sees across gaps, and gaps are not the
    edge of the canvas to it, so answers are nearly the same, not to the last digit as in other layouts.
    """
    lens = Equisolid(focal_length=focal_length, fov=2.2)
    middle = round(tilt / step) * step, 0.0
    turned = Orientation.from_roll_pitch(0.7, middle[1] + 0.99 * roll * step, middle[0] + 0.99 * pitch * step)
    cache = MeshCache(MANIFEST, Settings(roll_step=step, pitch_step=step))
    view, height = cache.view(turned, lens, SIZE), cache.mesh_height(0.7)
    whole = choose_layout(cache._build(height), MANIFEST)
    ours = shown_of(view.layout, view.levels, view.rotation, lens)
    theirs = shown_of(whole, levels_for(MANIFEST, whole, height, lens), view.rotation, lens)
    assert ours.keys() == theirs.keys()
    for strip in theirs:
        for one, other in zip(ours[strip], theirs[strip], strict=True):
            np.testing.assert_array_equal(one, other)
        assert len(np.unique(ours[strip][3])) == 1
