"""Objects at peaks, and the close look: a small network that decides about each peak of the mesh network.

It sees a patch of the picture in which the proposed object would fill the same disk at every distance. It says how
probable the object is, where its center is, and how large it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Floats, Image, Singles
from ..field.features import UPRIGHTS
from ..geometry.circle import Circle
from ..network.look_contract import LookContract
from .observation import Observation
from .patches import Tangents, cut_places
from .peaks import LARGEST_SIZE, Peaks, probability_of
from .prepared_view import PreparedView
from .settings import Settings
from .stopwatch import Stopwatch

_NEAR = 0.3
"""Places within this share of an object's radius around its center were meant to be its center."""

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


def around_bases(observation: Observation, radius: float) -> PreparedView:
    """The same points, where circles on the plane with this radius [m] are sought: one around each base."""
    return observation.view._replace(shape=Circle(radius))


def sought_bases(observation: Observation, class_name: str, look: Look | None) -> Sought:
    """The bases of uprights of a class that the network has peaks for. look: the look network for the class, if any."""
    radius = observation.manifest.radius if look is None else look.contract.upright_radius
    view = around_bases(observation, radius)
    return Sought(view, observation.peaks[class_name].apart(view), look)


Judged = Mapping[str, tuple[Sought, list[Judgment]]]
"""What was sought of each class, and what was found."""


def judge_classes(
    observation: Observation,
    looks: Mapping[str, Look],
    settings: Settings,
    watch: Stopwatch,
    explain: bool = False,
    uprights: bool = True,
) -> Judged:
    """What is at the peaks of each class that the network has peaks for.

    looks: look networks by class. uprights: also goal posts and robots. explain, watch: see `judge_peaks`. Raises
    ModelError if a look network does not run.
    """
    sought = {}
    for each in observation.manifest.classes:
        name = each.name
        if name in observation.manifest.peaks and each.kind == "object":
            sought[name] = Sought(observation.view, observation.peaks[name], looks.get(name))
        elif name in observation.manifest.peaks and uprights and name in UPRIGHTS:
            sought[name] = sought_bases(observation, name, looks.get(name))
    judged = judge_peaks(observation, list(sought.values()), settings, watch, explain)
    return {name: (of, found) for (name, of), found in zip(sought.items(), judged, strict=True)}


def judge_peaks(
    observation: Observation, sought: Sequence[Sought], settings: Settings, watch: Stopwatch, explain: bool = False
) -> list[list[Judgment]]:
    """The objects of each class at its peaks, most probable first.

    The scores of the peaks, times the look's `mesh_weight`, count in the probabilities, wherever the look moves them.
    explain: also the rejected ones, with their reasons. watch: gets the stages propose, and with a look look. Raises
    ModelError if a look network does not run.
    """
    if not sought:
        return []
    pairs = [(each, each.best) for each in sought]
    centers = [each.view.shape.center_along(peaks.rays, each.view.height) for each, peaks in pairs]
    watch.lap("propose")
    looks = {number: each.look for number, each in enumerate(sought) if each.look is not None}
    cut = cut_places(
        observation.pyramid,
        [sought[number].view for number in looks],
        [centers[number] for number in looks],
        [each.contract for each in looks.values()],
    )
    judged = []
    for number, (each, peaks) in enumerate(pairs):
        if number in looks:
            answers, centers[number] = _looked(each.view, looks[number], *cut.pop(0))
            if weight := looks[number].contract.mesh_weight:
                answers[:, 0] = probability_of(_log_odds(answers[:, 0]) + weight * peaks.scores)
        else:
            sizes = peaks.log_sizes + math.log(observation.manifest.radius / each.view.shape.radius)
            answers = np.column_stack([peaks.probabilities, np.zeros((len(peaks), 2)), sizes]).astype(np.float32)
        judged.append(judged_places(each.view, centers[number], answers, settings, explain))
    if any(each.look is not None for each in sought):
        watch.lap("look")
    return judged


def _looked(view: PreparedView, look: Look, patches: Image, tangents: Tangents) -> tuple[Singles, Floats]:
    """Answers (n, 4) of a look to patches, and the centers (n, 3) [m] of the objects that it saw."""
    answers = look.run(patches)
    rays = tangents.rays(answers[:, 1].astype(np.float64), answers[:, 2].astype(np.float64))
    return answers, view.shape.center_along(rays, view.height)


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
