"""Objects at peaks, and the close look: a small network that decides about each peak of the mesh network.

It sees a patch of the picture in which the proposed object would fill the same disk at every distance. It says how
probable the object is, where its center is, and how large it is. Then it may look again, where it saw the center.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Floats, Image, Singles
from ..network.look_contract import LookContract
from .judging import repeated
from .observation import Observation
from .peaks import LARGEST_SIZE, Peaks, probability_of
from .places import Places, PlanePlaces, cut_together, mean_center
from .prepared_view import PreparedView
from .pyramid import Pyramid
from .settings import Settings
from .stopwatch import Stopwatch

_SUREST = 1.0 - 1e-6
"""Limit of a probability: one that is rounded to 1 would outvote all others in a mean, and pass a threshold of 1."""


class Look(Protocol):
    """Anything that judges patches: a CloseLook, or a look network in torch."""

    @property
    def contract(self) -> LookContract: ...

    def run(self, patches: Image) -> Singles:
        """Answers (n, 4) to patches (n, size, size, 3), RGB uint8.

        They are the object's probability, the shift of its center to the right and down, in expected radii, and the
        logarithm of its apparent radius over the expected one. Raises ModelError.
        """


@dataclass(frozen=True, eq=False)
class Judgment:
    """A peak, after the close look if there is one.

    center (3,): of the object, relative to the camera in the mesh frame [m]. confidence: calibrated probability.
    scale: apparent size as a share of the expected one. reason: why it is not an object, or None.
    """

    center: Floats
    confidence: float
    scale: float
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class Sought:
    """Objects of a class, which are sought at peaks.

    view: of objects of their class. peaks: best first. look: the look network for the class; it judges the best peaks.
    Without it, the peaks are the objects.
    """

    view: PreparedView
    peaks: Peaks
    look: Look | None

    @property
    def best(self) -> Peaks:
        """The peaks that may be objects."""
        return self.peaks if self.look is None else self.peaks.part(slice(self.look.contract.max_proposals))

    def places(self, pyramid: Pyramid) -> PlanePlaces:
        """The places of the best peaks."""
        return PlanePlaces(pyramid, self.view, self.view.shape.center_along(self.best.rays, self.view.height))

    def answers(self, places: PlanePlaces, radius: float) -> Singles:
        """Answers (n, 4) to the places of the best peaks, as `Look.run` gives them.

        radius: of the object that the network's mesh is made for [m]. Raises ModelError if the look does not run.
        """
        peaks = self.best
        if self.look is None:
            sizes = peaks.log_sizes + math.log(radius / self.view.shape.radius)
            return np.column_stack([peaks.probabilities, np.zeros((len(peaks), 2)), sizes]).astype(np.float32)
        answers, weight = look_at(places, self.look), self.look.contract.mesh_weight
        if weight:
            answers[:, 0] = probability_of(_log_odds(answers[:, 0]) + weight * peaks.scores)
        return answers


def judge_peaks(
    observation: Observation, sought: Sequence[Sought], settings: Settings, watch: Stopwatch, explain: bool = False
) -> list[list[Judgment]]:
    """The objects of each class at its peaks, most probable first.

    The scores of the peaks, times the look's `mesh_weight`, count in the probabilities, wherever the look moves them.
    explain: also the rejected ones, with their reasons. watch: gets the stages propose, and with a look look. Raises
    ModelError if a look network does not run.
    """
    places = [each.places(observation.pyramid) for each in sought]
    watch.lap("propose")
    looks = {number: each.look.contract for number, each in enumerate(sought) if each.look is not None}
    cut_together(observation.pyramid, [places[number] for number in looks], list(looks.values()))
    judged = []
    for each, where in zip(sought, places, strict=True):
        answers = each.answers(where, observation.manifest.radius)
        judged.append(_judged(each.view, where.centers, answers, settings, explain))
    if looks:
        watch.lap("look")
    return judged


def look_at(places: Places, look: Look) -> Singles:
    """Look at n places, as often as the contract says, and move them to where an object was seen.

    Returns the last answers (n, 4) to each place, as `CloseLook.run` gives them. Raises ModelError if the network does
    not run.
    """
    answers = np.zeros((len(places), 4), dtype=np.float32)
    rows = np.arange(len(places))
    for _ in range(look.contract.passes if len(places) else 0):
        found = answers[rows] = look.run(places.cut(rows, look.contract))
        possible = places.move(rows, found[:, 1].astype(np.float64), found[:, 2].astype(np.float64))
        rows = rows[possible & (found[:, 0] > look.contract.promising)]
        if not len(rows):
            break
    return answers


def _log_odds(probabilities: Singles) -> Floats:
    """Log-odds of probabilities (n,), which count as neither 0 nor 1."""
    likely = np.clip(probabilities.astype(np.float64), 1.0 - _SUREST, _SUREST)
    return np.asarray(np.log(likely / (1.0 - likely)))


def _judged(view: PreparedView, centers: Floats, answers: Singles, settings: Settings, explain: bool) -> list[Judgment]:
    """Judgments of places with centers (c, 3) [m] and the network's answers (c, 4), most probable first."""
    kept: list[Floats] = []
    judged: list[Judgment] = []
    for number in np.argsort(-answers[:, 0], kind="stable"):
        center, (probability, _, _, log_size) = centers[number], answers[number].tolist()
        probability = min(probability, _SUREST)
        if probability < settings.min_confidence and not explain:
            break
        reason = None
        if center[2] >= 0.0:
            reason = "on the horizon or above it"
        elif probability < settings.min_confidence:
            reason = f"probability {probability:.2f}, below {settings.min_confidence:g}"
        else:
            reason = repeated(view, center, kept)
        if reason is None:
            kept.append(center)
            center = mean_center(view, centers, answers[:, 0], number)
        if reason is None or explain:
            scale = math.exp(min(max(log_size, -LARGEST_SIZE), LARGEST_SIZE))
            judged.append(Judgment(center, probability, scale, reason))
    return judged
