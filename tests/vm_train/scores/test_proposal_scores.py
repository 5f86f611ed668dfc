"""Scores of proposals against their definitions, on balls around a camera."""

import json
import math
import pickle
from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vm_train.scores.overlaps import TrueObject
from vm_train.scores.proposal_scores import REACHES, ProposalScores

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
    distance=st.sampled_from([0.2, 1.1, 1.9, 2.1, 3.1, 4.1, 9.1]),
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
    scores = ProposalScores(**rules)
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
        (ball.distance, nearest(ball, proposals))
        for truths, proposals in shown
        for ball in truths
        if ball.visible >= 0.25 and ball.radius >= 2.0
    ]
    for name, found in made.as_dict().items():
        if isinstance(found, dict):
            low, high = (0.0, math.inf) if name == "all" else map(float, name.split("-"))
            chosen = [offset for distance, offset in counted if low <= distance < high]
            assert found["truths"] == len(chosen)
            for reach in REACHES:
                hits = sum(offset <= reach for offset in chosen)
                assert found[f"recall_{reach:g}"] == (hits / len(chosen) if chosen else None)
    assert made.counts == [len(proposals) for _, proposals in shown]


@given(pictures, pictures)
def test_adding_scores_is_scoring_all_pictures_at_once_in_any_order(some, others):
    at_once = scored(some + others).as_dict()
    assert (scored(some) + scored(others)).as_dict() == at_once
    assert (scored(others) + pickle.loads(pickle.dumps(scored(some)))).as_dict() == at_once
    assert scored((some + others)[::-1]).as_dict() == at_once


@given(st.lists(st.lists(balls, max_size=3), min_size=1, max_size=4))
def test_proposals_at_the_true_centers_give_recall_1(shown):
    made = scored([(truths, [(ball, 0.0) for ball in truths]) for truths in shown]).row()
    assert made["truths"] == 0 or made["recall_0.5"] == made["recall_1"] == 1.0


def test_one_proposal_may_serve_two_balls_and_its_distance_does_not_matter():
    near, beside = Ball(2.0), Ball(2.0, 0.03)
    made = scored([([near, beside], [(near, 0.0)])])
    assert made.row() == {"truths": 2, "recall_0.5": 0.5, "recall_1": 1.0}
    far = ProposalScores()
    far.add([near.true()], 100.0 * near.center[None])
    assert far.row() == {"truths": 1, "recall_0.5": 1.0, "recall_1": 1.0}


def test_a_ball_of_unknown_bearing_is_never_proposed():
    scores = ProposalScores()
    scores.add([TrueObject(NOWHERE, np.full(3, np.nan), 5.0)], Ball(1.0).center[None])
    assert scores.row() == {"truths": 1, "recall_0.5": 0.0, "recall_1": 0.0}
    assert scores.row(0)["truths"] == 0


def test_without_pictures_there_are_no_scores():
    values = ProposalScores().as_dict()
    assert values["all"] == {"truths": 0, "recall_0.5": None, "recall_1": None}
    assert (values["pictures"], values["mean_count"], values["largest_count"]) == (0, None, 0)
    assert json.loads(json.dumps(values, allow_nan=False)) == values


def test_without_proposals_nothing_is_proposed():
    values = scored([([Ball(1.0)], [])]).as_dict()
    assert values["all"] == {"truths": 1, "recall_0.5": 0.0, "recall_1": 0.0}
    assert (values["mean_count"], values["largest_count"]) == (0.0, 0)
