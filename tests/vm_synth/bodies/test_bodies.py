"""Bodies of the training pictures: every kind over many seeds is a sound mesh of the size that was asked for."""

from __future__ import annotations

import numpy as np
import pytest

from vm_embedded.errors import InputError
from vm_synth.bodies import catalog as bodies
from vm_synth.bodies.carrier import CARRIERS, LOWEST, camera_carrier
from vm_synth.bodies.catalog import KINDS, ROBOTS, BodyRanges
from vm_synth.bodies.clutter import CLUTTER, FURNITURE, pedestal
from vm_synth.bodies.distractors import DISTRACTORS
from vm_synth.bodies.goals import goal
from vm_synth.bodies.solids import LABELS, Body, join_bodies, merged

SEEDS = range(12)
HEIGHTS = (0.2, 0.35, 0.55, 0.8, 1.0, 1.6, 2.2)
CLEARANCE = 0.06  # [m] between the camera's center and all parts of its carrier
LEAST_SLOPE = np.tan(np.radians(25.0))


def random(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def check(body: Body) -> None:
    """A body is a sound mesh within the budget."""
    count = len(body.vertices)
    assert body.label in LABELS
    assert 0 < len(body.triangles) <= 6000
    assert body.triangles.min() >= 0
    assert body.triangles.max() < count
    for array, shape in (
        (body.vertices, (count, 3)),
        (body.normals, (count, 3)),
        (body.colors, (count, 3)),
        (body.roughness, (count,)),
    ):
        assert array.shape == shape
        assert array.dtype == np.float32
        assert np.isfinite(array).all()
    assert body.triangles.dtype == np.int32
    np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1.0, atol=1e-4)
    assert body.colors.min() >= 0.0
    assert body.colors.max() <= 1.0
    assert body.roughness.min() >= 0.05 - 1e-6
    assert body.roughness.max() <= 1.0


def outward_share(body: Body) -> float:
    """Share of the surface whose winding agrees with its normals."""
    corner = body.vertices.astype(np.float64)[body.triangles]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    agree = np.einsum("ij,ij->i", area, body.normals[body.triangles].mean(axis=1)) >= 0.0
    size = np.linalg.norm(area, axis=1)
    return float(size[agree].sum() / size.sum())


def surface(body: Body) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Points all over the triangles of a body (n, 3) [m]."""
    weights = np.array([(i, j, 10 - i - j) for i in range(11) for j in range(11 - i)]) / 10.0
    points = np.einsum("wk,tkc->twc", weights, body.vertices.astype(np.float64)[body.triangles])
    return np.asarray(points.reshape(-1, 3))


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_are_sound_and_stand_on_the_plane(kind: str) -> None:
    for seed in SEEDS:
        drawn = KINDS[kind](random(seed), 0.4)
        for body in drawn:
            check(body)
            assert outward_share(body) > 0.99
        assert abs(min(body.low[2] for body in drawn)) < 1e-3


@pytest.mark.parametrize("size", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("kind", [*CLUTTER, *FURNITURE, *DISTRACTORS])
def test_things_have_the_size_asked_for(kind: str, size: float) -> None:
    longest = 2.0 * size if kind in DISTRACTORS else size
    for seed in SEEDS:
        whole = merged(KINDS[kind](random(seed), size))
        np.testing.assert_allclose((whole.high - whole.low).max(), longest, rtol=1e-4)
        np.testing.assert_allclose((whole.high + whole.low)[:2], 0.0, atol=1e-4 * longest)


@pytest.mark.parametrize("height", [0.4, 1.0, 1.6])
def test_robots_and_people_have_the_height_asked_for(height: float) -> None:
    for seed in range(15):
        (robot,) = bodies.ROBOTS["humanoid"](random(seed), height)
        assert 0.75 * height < robot.high[2] < 1.05 * height
        (person,) = bodies.PEOPLE["person"](random(seed), height)
        assert 0.85 * height < person.high[2] < 1.1 * height
        (wheeled,) = bodies.ROBOTS["wheeled"](random(seed), height)
        np.testing.assert_allclose(wheeled.high[2], height, rtol=1e-4)
        (nao,) = bodies.ROBOTS["nao"](random(seed), height)
        assert 0.45 < nao.high[2] < 0.62


def test_labels_tell_robots_from_the_rest() -> None:
    for kind in KINDS:
        assert {body.label for body in KINDS[kind](random(0), 0.4)} == {"robot" if kind in ROBOTS else "environment"}


@pytest.mark.parametrize("seed", range(20))
def test_goal(seed: int) -> None:
    posts, *rest = goal(random(seed), 2.6, 1.2, 0.6)
    for body in (posts, *rest):
        check(body)
        assert body.low[2] > -1e-3
    assert posts.label == "goal"
    assert {body.label for body in rest} == {"environment"}
    np.testing.assert_allclose(posts.low[2], 0.0, atol=1e-3)
    # Width and height are those of the opening.
    wide, tall = posts.high[1] - posts.low[1], posts.high[2]
    assert 2.6 + 2 * 0.10 - 1e-3 <= wide <= 2.6 + 2 * 0.12 + 1e-3
    assert 1.2 + 0.10 - 1e-3 <= tall <= 1.2 + 0.12 + 1e-3
    assert -0.65 < min(body.low[0] for body in rest) < -0.6


@pytest.mark.parametrize("seed", SEEDS)
def test_pedestal_is_flat_at_its_height(seed: int) -> None:
    (body,) = pedestal(random(seed), 0.35, 0.2)
    check(body)
    np.testing.assert_allclose([body.low[2], body.high[2]], [0.0, 0.35], atol=1e-5)
    top = body.vertices[body.vertices[:, 2] > 0.35 - 1e-5]
    assert (np.abs(top[:, :2]).max(axis=0) > 0.099).all()


@pytest.mark.long
@pytest.mark.parametrize("kind", CARRIERS)
def test_own_body_keeps_clear_of_the_camera(kind: str) -> None:
    for height in (each for each in HEIGHTS if each >= LOWEST[kind]):
        for seed in SEEDS:
            body = camera_carrier(random(seed), height, kind)
            check(body)
            assert body.label == "environment"
            assert body.low[2] > -1e-3
            points = surface(body) - (0.0, 0.0, height)
            assert np.linalg.norm(points, axis=1).min() >= CLEARANCE
            slope = -points[:, 2] / np.maximum(np.linalg.norm(points[:, :2], axis=1), 1e-9)
            assert (slope > LEAST_SLOPE).mean() > 0.97


def test_the_same_seed_draws_the_same_body() -> None:
    for kind in KINDS:
        first, again, other = (merged(KINDS[kind](random(seed), 0.4)) for seed in (3, 3, 4))
        for name, array in vars(first).items():
            np.testing.assert_array_equal(array, getattr(again, name))
        assert not np.array_equal(first.colors, other.colors)


def test_moved_turns_before_it_moves() -> None:
    (body,) = CLUTTER["bag"](random(0), 0.4)
    moved = body.moved(np.pi / 2.0, (1.0, 2.0, 3.0))
    x, y, z = body.vertices.T
    np.testing.assert_allclose(moved.vertices, np.stack([1.0 - y, 2.0 + x, 3.0 + z], axis=1), atol=1e-5)
    np.testing.assert_allclose(moved.normals[:, 1], body.normals[:, 0], atol=1e-5)
    assert (moved.label, moved.name) == (body.label, body.name)


def test_joined_keeps_triangles_and_labels_apart() -> None:
    parts = [*goal(random(1), 2.6, 1.2, 0.6), *ROBOTS["nao"](random(1), 0.6), *CLUTTER["can"](random(1), 0.1)]
    whole = join_bodies(parts)
    np.testing.assert_array_equal(
        whole.vertices[whole.triangles], np.concatenate([part.vertices[part.triangles] for part in parts])
    )
    assert len(whole.labels) == len(whole.triangles)
    assert [LABELS[k] for k in whole.labels] == [part.label for part in parts for _ in part.triangles]


def test_joined_of_nothing_is_empty() -> None:
    whole = join_bodies([])
    assert whole.vertices.shape == (0, 3)
    assert whole.triangles.shape == (0, 3)
    assert whole.labels.shape == (0,)


def test_ranges_draw_what_they_allow() -> None:
    ranges = BodyRanges(clutter_kinds=("box",), clutter_size=(0.1, 0.2), robot_kinds=("wheeled",))
    for seed in SEEDS:
        (box,) = bodies.draw_clutter(random(seed), ranges)
        assert box.name == "box"
        assert 0.0999 < (box.high - box.low).max() < 0.2001
        (robot,) = bodies.draw_robot(random(seed), ranges)
        assert robot.name == "wheeled robot"
        for drawn in (bodies.draw_furniture(random(seed), ranges), bodies.draw_person(random(seed), ranges)):
            assert drawn[0].label == "environment"


def test_white_spheres_are_never_of_the_balls_radius() -> None:
    ranges = BodyRanges(distractor_kinds=("white_sphere",), distractor_radius=(0.06, 0.09))
    for seed in range(40):
        (ball,) = bodies.draw_distractor(random(seed), ranges, ball_radius=0.075)
        assert abs(ball.high[2] / 2.0 / 0.075 - 1.0) > 0.299


def test_carriers_need_their_height() -> None:
    ranges = BodyRanges()
    assert bodies.draw_carrier(random(0), ranges, 0.1) is None
    assert {bodies.draw_carrier(random(seed), ranges, 0.22).name for seed in SEEDS} == {"own tripod"}  # type: ignore[union-attr]
    assert len({getattr(bodies.draw_carrier(random(seed), ranges, 1.5), "name", "") for seed in range(60)}) == len(
        CARRIERS
    )


@pytest.mark.parametrize(
    ("entry", "value"), [("clutter_size", (0.0, 0.5)), ("robot_kinds", ("dragon",)), ("robot_height", (1.0, 0.5))]
)
def test_ranges_name_a_wrong_entry(entry: str, value: tuple[object, ...]) -> None:
    with pytest.raises(InputError, match=entry):
        BodyRanges(**{entry: value})  # type: ignore[arg-type]
