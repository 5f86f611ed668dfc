"""Posts and robots are found where they stand, with their width, nearest first."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.field.uprights import POST, ROBOT, Base, apart, find_uprights

from .ground import ACROSS, HEIGHT, behind, ground, mesh, turned


def found_among(things, name, rules, angle=0.0):
    """Finds things, each with base, width and height, on a field."""
    places = mesh()
    labels = np.full(len(places), "field", dtype="U8")
    for base, width, height in sorted(things, key=lambda each: -np.hypot(*each[0])):
        labels[behind(places, base, width, height)] = name
    points = ground(places @ turned(angle), labels)
    return find_uprights(points, points.classes[name], rules)


@given(distance=st.floats(1.0, 7.0), azimuth=st.floats(-0.9, 0.9), angle=st.floats(-3.1, 3.1))
def test_a_post_is_found_where_it_stands(distance, azimuth, angle):
    base = distance * np.array([np.cos(azimuth), np.sin(azimuth)])
    found = found_among([(base, 0.13, 1.1)], "goal", POST, angle)
    assert len(found) == 1
    ring = ACROSS * np.hypot(distance, HEIGHT) / HEIGHT
    assert np.hypot(*(found[0].position @ turned(-angle) - base)) < 0.7 * ring + 0.06
    assert found[0].width < 0.13 + 3.0 * ACROSS
    assert found[0].confidence == pytest.approx(0.95)


def test_both_posts_of_a_goal_are_found_and_its_bar_is_not():
    posts = [np.array([4.0, 0.9]), np.array([4.0, -0.9])]
    places = mesh()
    labels = np.full(len(places), "field", dtype="U8")
    for base in posts:
        labels[behind(places, base, 0.12, 0.8)] = "goal"
    r, across = places[:, 0], places[:, 1] * 4.0 / places[:, 0]
    top = HEIGHT * (1.0 - 4.0 / np.maximum(r, 4.0))
    labels[(np.abs(across) < 0.9) & (top > 0.7) & (top < 0.8)] = "goal"
    points = ground(places, labels)
    found = find_uprights(points, points.classes["goal"], POST)
    assert len(found) == 2
    assert sorted(each.position[1] for each in found) == pytest.approx([-0.9, 0.9], abs=0.1)


def test_things_come_nearest_first_with_their_widths():
    found = found_among([((3.0, 1.0), 0.4, 0.6), ((1.5, -0.6), 0.3, 0.6)], "robot", ROBOT)
    assert [round(float(np.hypot(*each.position)), 0) for each in found] == [2.0, 3.0]
    assert [each.width for each in found] == pytest.approx([0.3, 0.4], abs=0.1)


def test_two_legs_are_one_robot():
    found = found_among([((2.0, 0.08), 0.08, 0.3), ((2.0, -0.08), 0.08, 0.3), ((2.02, 0.0), 0.3, 0.6)], "robot", ROBOT)
    assert len(found) == 1
    assert found[0].position == pytest.approx([2.05, 0.0], abs=0.12)


def test_single_points_are_nothing():
    places = mesh()
    labels = np.full(len(places), "field", dtype="U8")
    labels[np.random.default_rng(0).choice(len(places), 30, replace=False)] = "goal"
    points = ground(places, labels)
    assert find_uprights(points, points.classes["goal"], POST) == []


def test_a_frame_of_noise_has_a_limited_number():
    places = mesh()
    labels = np.random.default_rng(1).choice(["field", "robot"], len(places))
    points = ground(places, labels)
    assert len(find_uprights(points, points.classes["robot"], ROBOT)) <= 20


def test_wide_near_things_keep_the_order():
    found = found_among([((1.5, 0.0), 0.9, 0.8), ((1.6, -1.2), 0.2, 0.8)], "robot", ROBOT)
    ranges = [float(np.hypot(*each.position)) for each in found]
    assert ranges == sorted(ranges)
    assert len(ranges) == 2


def test_a_wall_is_no_robot():
    assert found_among([((2.0, 0.0), 3.5, 0.8)], "robot", ROBOT) == []


places = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))


@given(st.lists(st.tuples(places, st.floats(0.05, 2.0)), max_size=12))
def test_of_bases_of_one_thing_the_most_probable_is_kept(things):
    """Two are of one thing within 12 % of the distance of the better one, or within half its width."""
    bases = [Base(np.array(place), width, 0.9 - 0.01 * number) for number, (place, width) in enumerate(things)]
    kept = []
    for each in bases:
        limits = [max(0.12 * np.hypot(*better.position), better.width / 2.0) for better in kept]
        away = [np.hypot(*(each.position - better.position)) for better in kept]
        if all(distance >= limit for distance, limit in zip(away, limits, strict=True)):
            kept.append(each)
    found = apart(bases)
    assert {id(each) for each in found} == {id(each) for each in kept}
    ranges = [float(np.hypot(*each.position)) for each in found]
    assert ranges == sorted(ranges)
