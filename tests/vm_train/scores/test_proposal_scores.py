"""Scores of proposals against their definitions, on balls around a camera."""

import json
import math
import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.errors import InputError
from vm_train.scores.overlaps import TrueObject
from vm_train.scores.proposal_scores import REACHES, ProposalScores

EDGES = np.array([0.0, 2.0, 4.0])
HEIGHT = 0.5
NOWHERE = np.zeros((1, 1), dtype=bool)


@dataclass(frozen=True)
class Ball:
    """A true ball: distance on the plane [m], bearing [rad], radius [m], radius in the picture [px], visible share."""

    distance: float
    bearing: float = 0.0
    size: float = 0.1
    radius: float = 10.0
    visible: float = 1.0

    @property
    def center(self):
        """Relative to the camera."""
        x, y = self.distance * math.cos(self.bearing), self.distance * math.sin(self.bearing)
        return np.array([x, y, self.size - HEIGHT])

    def true(self):
        far = float(np.linalg.norm(self.center))
        position = self.center + np.array([0.0, 0.0, HEIGHT])
        return TrueObject(
            NOWHERE, position, self.radius, self.visible, self.center / far, math.asin(min(self.size / far, 1.0))
        )

    def off(self, radii):
        """A place so many apparent radii to the side of its center."""
        axis = self.center / np.linalg.norm(self.center)
        side = np.cross(axis, [0.0, 0.0, 1.0])
        angle = radii * self.true().angular_radius
        return 3.0 * (math.cos(angle) * axis + math.sin(angle) * side / np.linalg.norm(side))


balls = st.builds(
    Ball,
    distance=st.sampled_from([0.2, 1.0, 1.9, 2.1, 3.0, 4.1, 9.0]),
    bearing=st.floats(-3.0, 3.0),
    size=st.sampled_from([0.05, 0.1, 0.12]),
    radius=st.sampled_from([1.0, 2.0, 2.9, 3.0, 5.0, 19.9, 40.0, 500.0]),
    visible=st.sampled_from([0.0, 0.24, 0.25, 0.4, 0.7, 0.95, 1.0]),
)
offsets = st.sampled_from([0.0, 0.3, 0.49, 0.51, 0.9, 0.99, 1.01, 2.0])
pictures = st.lists(
    st.tuples(st.lists(balls, max_size=3), st.lists(st.tuples(balls, offsets), max_size=4)).map(
        lambda each: (each[0], each[1] + [(ball, 0.7) for ball in each[0][:1]])
    ),
    max_size=4,
)


def scored(shown, **rules):
    """Scores of pictures: true balls, and proposals so many radii beside balls."""
    scores = ProposalScores(EDGES, **rules)
    for truths, proposals in shown:
        centers = np.array([ball.off(radii) for ball, radii in proposals]).reshape(-1, 3)
        scores.add([each.true() for each in truths], centers)
    return scores


def nearest(ball, proposals):
    """Offset of the nearest proposal [apparent radii]."""
    places = [other.off(radii) for other, radii in proposals]
    axis = ball.center / np.linalg.norm(ball.center)
    angles = [math.atan2(np.linalg.norm(np.cross(axis, each)), axis @ each) for each in places]
    return min(angles, default=math.inf) / ball.true().angular_radius


@given(pictures)
def test_recalls_are_their_definitions(shown):
    made = scored(shown, min_radius=2.0)
    counted = [
        (ball, nearest(ball, proposals))
        for truths, proposals in shown
        for ball in truths
        if ball.visible >= 0.25 and ball.radius >= 2.0
    ]

    def check(found, chosen):
        assert found.truths == len(chosen)
        assert found.hits == tuple(sum(offset <= reach for _, offset in chosen) for reach in REACHES)

    check(made.recall(), counted)
    for measure in ("distance", "radius", "visible"):
        bins = made.recalls_by(measure)
        for name, found in bins.items():
            low, high = map(float, name.split("-"))
            closed = measure == "visible" and high == 1.0
            values = [(getattr(ball, measure), (ball, offset)) for ball, offset in counted]
            check(found, [each for value, each in values if low <= value < high or (closed and value == 1.0)])
        if measure != "distance":
            assert sum(each.truths for each in bins.values()) == len(counted)
    assert made.counts == [len(proposals) for _, proposals in shown]


@given(pictures, pictures)
def test_adding_scores_is_scoring_all_pictures_at_once_in_any_order(some, others):
    at_once = scored(some + others).as_dict()
    assert (scored(some) + scored(others)).as_dict() == at_once
    assert (scored(others) + pickle.loads(pickle.dumps(scored(some)))).as_dict() == at_once
    assert scored((some + others)[::-1]).as_dict() == at_once


@given(st.lists(st.lists(balls, max_size=3), min_size=1, max_size=4))
def test_proposals_at_the_true_centers_give_recall_1(shown):
    made = scored([(truths, [(ball, 0.0) for ball in truths]) for truths in shown])
    assert all(share == 1.0 or made.recall().truths == 0 for share in made.recall().recalls)


@given(pictures, balls, offsets)
def test_a_further_proposal_never_lowers_a_recall(shown, ball, radii):
    more = [(truths, [*proposals, (ball, radii)]) for truths, proposals in shown]
    before, after = scored(shown).recall(), scored(more).recall()
    assert all(one <= other for one, other in zip(before.hits, after.hits, strict=True))


def test_one_proposal_may_serve_two_balls_and_its_distance_does_not_matter():
    near, beside = Ball(2.0), Ball(2.0, 0.03)
    made = scored([([near, beside], [(near, 0.0)])])
    assert made.recall().hits == (1, 2)
    far = ProposalScores()
    far.add([near.true()], 100.0 * near.center[None])
    assert far.recall().hits == (1, 1)


def test_a_ball_of_unknown_bearing_is_never_proposed():
    scores = ProposalScores()
    scores.add([TrueObject(NOWHERE, np.full(3, np.nan), 5.0)], Ball(1.0).center[None])
    assert scores.recall().as_dict() == {"truths": 1, "recall_0.5": 0.0, "recall_1": 0.0}
    assert all(each.truths == 0 for each in scores.recalls_by("distance").values())


def test_without_pictures_there_are_no_scores():
    values = ProposalScores().as_dict()
    assert values["all"] == {"truths": 0, "recall_0.5": None, "recall_1": None}
    assert (values["pictures"], values["mean_count"], values["largest_count"]) == (0, None, 0)
    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_without_proposals_nothing_is_proposed():
    values = scored([([Ball(1.0)], [])]).as_dict()
    assert values["all"] == {"truths": 1, "recall_0.5": 0.0, "recall_1": 0.0}
    assert (values["mean_count"], values["largest_count"]) == (0.0, 0)


def test_rules_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="two or more rising"):
        ProposalScores(np.array([3.0, 1.0]))
    with pytest.raises(InputError, match="do not add up"):
        ProposalScores() + ProposalScores(min_radius=2.0)


def test_a_recall_of_large_and_visible_objects_leaves_out_the_others():
    large, small, hidden = Ball(1.0), Ball(1.0, bearing=1.0, radius=2.9), Ball(1.0, bearing=2.0, visible=0.5)
    scores = ProposalScores()
    scores.add([each.true() for each in (large, small, hidden)], np.array([large.off(0.1), hidden.off(0.2)]))
    assert (scores.recall().truths, scores.recall().hits) == (3, (2, 2))
    chosen = scores.recall(min_radius=3.0, min_visible=0.6)
    assert (chosen.truths, chosen.hits) == (1, (1, 1))
