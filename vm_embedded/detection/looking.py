"""Objects at peaks, and the close look: a small network that decides about each peak of the mesh network.

It sees a patch of the picture in which the proposed object would fill the same disk at every distance. It says how
probable the object is, where its center is, and how large it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from ..arrays import Chosen, Floats, Image, Singles
from ..field.features import UPRIGHTS
from ..geometry.shapes import Circle
from ..network.look_contract import LookContract
from .observation import Observation, Stopwatch
from .patches import cut_places
from .peaks import LARGEST_SIZE, Peaks, probability_of
from .prepared_view import PreparedView
from .settings import Settings

_NEAR = 0.3
"""Places within this share of an object's radius around its center were meant to be its center."""

_DOUBTFUL = 3.0
"""Log-odds up to which a place gets a second look: probabilities from 0.05 to 0.95."""

_SUREST = 1.0 - 1e-6
"""Limit of a probability: one that is rounded to 1 would outvote all others in a mean, and pass a threshold of 1."""


class Look(Protocol):
    """Anything that judges patches: a CloseLook, or a look network in torch."""

    @property
    def contract(self) -> LookContract: ...

    def run(self, patches: Image) -> Singles:
        """Answers (n, C, 4) to patches (n, size, size, 3), RGB uint8.

        For each class of the contract, they are the object's probability, the shift of its center to the right and
        down, in expected radii, and the logarithm of its apparent radius over the expected one. Raises ModelError.
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

    view: of objects of their class. peaks: that may be objects, best first. number: of the class among those of the
    look network; None if it does not judge the class, and the peaks are the objects.
    """

    view: PreparedView
    peaks: Peaks
    number: int | None

    @classmethod
    def of(cls, observation: Observation, name: str, contract: LookContract | None) -> Sought:
        """The objects of a class that the network has peaks for. The base of an upright is a circle on the plane.

        contract: of the look network, if there is one.
        """
        number = contract.names.index(name) if contract is not None and name in contract.names else None
        view, peaks = observation.view, observation.peaks[name]
        if observation.manifest.classes[observation.manifest.column(name)].kind == "upright":
            judged = None if contract is None or number is None else contract.classes[number]
            view = around_bases(observation, observation.manifest.radius if judged is None else judged.upright_radius)
            peaks = peaks.apart(view)
        most = len(peaks) if contract is None or number is None else contract.max_proposals
        return cls(view, peaks.part(slice(most)), number)


def around_bases(observation: Observation, radius: float) -> PreparedView:
    """The same points, where circles on the plane with this radius [m] are sought: one around each base."""
    return observation.view._replace(shape=_circle(radius))


_circle = lru_cache(maxsize=8)(Circle)
"""The circles with a few radii: to make and check one takes longer than to use it."""


Judged = Mapping[str, tuple[Sought, list[Judgment]]]
"""What was sought of each class, and what was found."""


def judge_classes(
    observation: Observation,
    look: Look | None,
    settings: Settings,
    watch: Stopwatch,
    explain: bool = False,
    uprights: bool = True,
) -> Judged:
    """What is at the peaks of each class that the network has peaks for.

    uprights: also goal posts and robots. look, explain, watch: see `judge_peaks`. Raises ModelError if the look network
    does not run.
    """
    contract = None if look is None else look.contract
    sought = {
        each.name: Sought.of(observation, each.name, contract)
        for each in observation.manifest.classes
        if each.name in observation.manifest.peaks and (each.kind == "object" or (uprights and each.name in UPRIGHTS))
    }
    judged = judge_peaks(observation, list(sought.values()), look, settings, watch, explain)
    return {name: (of, found) for (name, of), found in zip(sought.items(), judged, strict=True)}


def judge_peaks(
    observation: Observation,
    sought: Sequence[Sought],
    look: Look | None,
    settings: Settings,
    watch: Stopwatch,
    explain: bool = False,
) -> list[list[Judgment]]:
    """The objects of each class at its peaks, most probable first.

    look: the look network; it judges the classes that have a number. explain: also the rejected ones, with their
    reasons. watch: gets the stages propose, and with a look look. Raises ModelError if the look network does not run.
    """
    if not sought:
        return []
    watch.lap("propose")
    answers: dict[int, tuple[Singles, Floats]] = {}
    seen = [number for number, each in enumerate(sought) if each.number is not None and len(each.peaks)]
    if look is not None and seen:
        answers = dict(zip(seen, _looked(observation, [sought[number] for number in seen], look), strict=True))
    judged = []
    for number, each in enumerate(sought):
        if number in answers:
            own, centers = answers[number]
        else:
            centers = each.view.shape.center_along(each.peaks.rays, each.view.height)
            sizes = each.peaks.log_sizes + math.log(observation.manifest.radius / each.view.shape.radius)
            values = [each.peaks.probabilities, np.zeros((len(each.peaks), 2)), sizes]
            own = np.column_stack(values).astype(np.float32)
        judged.append(judged_places(each.view, centers, own, settings, explain))
    if any(each.number is not None for each in sought):
        watch.lap("look")
    return judged


def _looked(observation: Observation, sought: Sequence[Sought], look: Look) -> list[tuple[Singles, Floats]]:
    """For each class, the answers (n, 4) of a look to its peaks, and the centers (n, 3) [m] of the objects it saw.

    The scores of the peaks, times the class's `mesh_weight`, count in the probabilities, wherever the look moves them.
    Where the probability is doubtful, the look sees the mirror image of a second patch, around the place that it saw
    in the first one, and the mean of both answers counts.
    """
    counts = [len(each.peaks) for each in sought]
    of, peaks = np.repeat(np.arange(len(sought)), counts), [each.peaks for each in sought]
    halves = np.array([each.view.shape.half_size for each in sought])[of]
    numbers = np.array([each.number for each in sought])[of]
    weights = np.array([each.mesh_weight for each in look.contract.classes])[numbers]
    centers = _centers(sought, of, np.concatenate([each.rays for each in peaks]))
    seen = weights * np.concatenate([each.scores for each in peaks])

    patches, tangents = cut_places(observation.pyramid, observation.view, centers, halves, look.contract)
    answers = look.run(patches)[np.arange(len(of)), numbers]
    rays = tangents.rays(answers[:, 1].astype(np.float64), answers[:, 2].astype(np.float64))
    odds = _log_odds(answers[:, 0])
    doubtful = np.flatnonzero(np.abs(odds + seen) < _DOUBTFUL)
    if len(doubtful):
        again = _centers(sought, of[doubtful], rays[doubtful])
        patches, tangents = cut_places(observation.pyramid, observation.view, again, halves[doubtful], look.contract)
        second = look.run(np.ascontiguousarray(patches[:, :, ::-1]))[np.arange(len(doubtful)), numbers[doubtful]]
        rays[doubtful] += tangents.rays(-second[:, 1].astype(np.float64), second[:, 2].astype(np.float64))
        odds[doubtful] = 0.5 * (odds[doubtful] + _log_odds(second[:, 0]))
        answers[doubtful, 3] = 0.5 * answers[doubtful, 3] + 0.5 * second[:, 3]
        rays /= np.sqrt((rays * rays).sum(axis=1))[:, None]
    answers[:, 0] = probability_of(odds + seen)
    centers, ends = _centers(sought, of, rays), np.cumsum(counts)
    parts = [slice(end - count, end) for end, count in zip(ends.tolist(), counts, strict=True)]
    return [(answers[part], centers[part]) for part in parts]


def _centers(sought: Sequence[Sought], of: Chosen, rays: Floats) -> Floats:
    """Centers (n, 3) [m] along rays (n, 3) of objects of these classes (n,), one after the other."""
    ends = np.searchsorted(of, np.arange(len(sought) + 1)).tolist()
    return np.concatenate(
        [
            each.view.shape.center_along(rays[start:end], each.view.height)
            for each, start, end in zip(sought, ends[:-1], ends[1:], strict=True)
        ]
    )


def _log_odds(probabilities: Singles) -> Floats:
    """Log-odds of probabilities (n,), which count as neither 0 nor 1."""
    likely = np.clip(probabilities.astype(np.float64), 1.0 - _SUREST, _SUREST)
    return np.asarray(np.log(likely / (1.0 - likely)))


def judged_places(
    view: PreparedView, centers: Floats, answers: Singles, settings: Settings, explain: bool
) -> list[Judgment]:
    """Judgments of places with centers (c, 3) [m] and the network's answers (c, 4), most probable first.

    Several peaks move to the same object, each with an error of its own: the most probable one stays, at the mean of
    all places near it, weighted by their probabilities.
    """
    probabilities = np.minimum(answers[:, 0], _SUREST)
    order = np.argsort(-probabilities, kind="stable")
    if not explain:
        order = order[probabilities[order] >= settings.min_confidence]
    if not len(order):
        return []
    rays = centers / np.sqrt((centers * centers).sum(axis=1))[:, None]
    offsets = view.shape.offset(rays, centers[order], view.height)
    scales = np.exp(np.minimum(np.maximum(answers[:, 3], -LARGEST_SIZE), LARGEST_SIZE))
    kept: list[int] = []
    judged: list[Judgment] = []
    for row, number in enumerate(order.tolist()):
        center, probability, reason = centers[number], float(probabilities[number]), None
        if center[2] >= 0.0:
            reason = "on the horizon or above it"
        elif probability < settings.min_confidence:
            reason = f"probability {probability:.2f}, below {settings.min_confidence:g}"
        elif kept and offsets[kept, number].min() < 1.0:
            same = centers[order[kept[int(offsets[kept, number].argmin())]]]
            reason = f"the same object as the one at {np.linalg.norm(same):.2f} m"
        else:
            kept.append(row)
            near = offsets[row] < _NEAR
            near[number] = True  # far away, rounding may leave it out
            center = view.shape.center_along(((near * probabilities) @ rays)[None], view.height)[0]
        if reason is None or explain:
            judged.append(Judgment(center, probability, float(scales[number]), reason))
    return judged
