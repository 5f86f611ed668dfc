"""The close look: a small network decides about each proposal of the mesh network.

It sees a patch of the picture in which the proposed object would fill the same disk at every distance. It says how
probable the object is, where its center is, and how large it is. Then it may look again, where it saw the center. A
still smaller network, the glance, may go before it and leave out what is clearly nothing. A third one, the wide look,
may go after both: it sees more of the surroundings of what may be an object.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Chosen, Floats, Image, Mask, Singles
from ..network.look_contract import LookContract
from .judging import repeated
from .observation import Observation, Stopwatch
from .peaks import LARGEST_SIZE, probability_of
from .places import Places, PlanePlaces, mean_center
from .prepared_view import PreparedView
from .proposals import best_apart, propose
from .settings import Settings


@dataclass(frozen=True)
class _Rules:
    """How to look at a kind of object.

    worth: probability that a place needs from the answer before, to be worth this look. doubtful: probabilities between
    which it gets a second opinion. zooms: sides of the patches for that, as shares of the usual side.
    """

    worth: float
    doubtful: tuple[float, float]
    zooms: tuple[float, ...]


_OBJECT = _Rules(worth=0.005, doubtful=(0.03, 0.97), zooms=(0.9, 1.1))

# A wide look is large, so it sees only what the close look takes seriously. Where it is sure, a mirror image would not
# change much.
_WIDE = _Rules(worth=0.03, doubtful=(0.15, 0.8), zooms=(1.0,))

# A glance is less sure about uprights: at 0.005, it would pass on nearly all proposals. The base of an upright is seen
# less exactly than the center of an object, so its place is a mean also if it is sure. The size of what stands on a
# base says less, so patches of other sizes don't help.
_UPRIGHT = _Rules(worth=0.03, doubtful=(0.03, 1.0), zooms=(1.0,))

_LARGE = 24.0
"""Radius of an object, or of the circle around a base, from which no wide look follows [px]: the close look sees
enough, and the surroundings of a near object are often beyond the border of the picture."""

_EARLIER = 0.3
"""Weight of the answer before the last one in the mean of both: other errors were made there."""

_SUREST = 1.0 - 1e-6
"""Limit of a probability: one that is rounded to 1 would outvote all others in a mean, and pass a threshold of 1."""


class Look(Protocol):
    """Anything that judges patches: a CloseLook, or a look network in torch."""

    @property
    def contract(self) -> LookContract: ...

    @property
    def glance(self) -> Look | None: ...

    def run(self, patches: Image) -> Singles:
        """Answers (n, 4) to patches (n, size, size, 3), RGB uint8.

        They are the object's probability, the shift of its center to the right and down, in expected radii, and the
        logarithm of its apparent radius over the expected one. Raises ModelError.
        """


@dataclass(frozen=True, eq=False)
class Judgment:
    """A proposal after the close look.

    center (3,): of the object, relative to the camera in the mesh frame [m]. confidence: calibrated probability.
    scale: apparent size as a share of the expected one. reason: why it is not an object, or None.
    """

    center: Floats
    confidence: float
    scale: float
    reason: str | None = None


def look_closely(
    observation: Observation,
    look: Look,
    probabilities: Singles,
    settings: Settings,
    watch: Stopwatch,
    explain: bool = False,
) -> list[Judgment]:
    """The objects of the look's class, most probable first.

    The class's peaks propose them, or, without peaks, the slots' probabilities (m,). With a `mesh_weight`, the score of
    a peak counts in the probability of its object, wherever the look moves it. explain: also the rejected
    proposals, with their reasons. watch: gets the stages propose and look. Raises ModelError if the network does not
    run.
    """
    contract = look.contract
    most = settings.max_proposals
    centers, scores = propose(observation, contract.object_class, probabilities, contract.above, most)
    watch.lap("propose")
    places = PlanePlaces(observation, centers)
    answers = look_at(places, look)
    if scores is not None and contract.mesh_weight:
        answers[:, 0] = probability_of(_log_odds(answers[:, 0]) + contract.mesh_weight * scores)
    judged = _judged(observation.view, places.centers, answers, settings, explain)
    watch.lap("look")
    return judged


def judge_peaks(observation: Observation, class_name: str, settings: Settings, explain: bool = False) -> list[Judgment]:
    """The objects of a class with peaks and without a close look, most probable first. explain: as `look_closely`."""
    view, manifest = observation.view, observation.manifest
    peaks = observation.find_peaks(class_name, settings.max_proposals)
    sizes = peaks.log_sizes + math.log(manifest.radius / manifest.object_radius)
    answers = np.column_stack([peaks.probabilities, np.zeros((len(peaks), 2)), sizes]).astype(np.float32)
    return _judged(view, view.shape.center_along(peaks.rays, view.height), answers, settings, explain)


def worth_of(contract: LookContract) -> float:
    """Probability that a place needs from the answer before, to be worth a look."""
    return _rules_of(contract).worth


def _rules_of(contract: LookContract) -> _Rules:
    if contract.upright_radius:
        return _UPRIGHT
    return _WIDE if contract.is_wide else _OBJECT


def chain_of(look: Look) -> list[Look]:
    """A look and its glances, in the order in which they judge."""
    before = [] if look.glance is None else chain_of(look.glance)
    return [*before, look]


def look_at(places: Places, look: Look) -> Singles:
    """Look at n places, as often as the contracts of look and glance say, and move them to where an object was seen.

    In its last pass, if there are several, a doubtful place gets a second opinion. If that is the third or a later one,
    its probability is a mean with the one before, unless that is the answer of the first of several networks. A wide
    look judges only the most probable of the places that show the same object; the others keep their answers, but are
    not more probable. Returns the last answers (n, 4) to each place, as `CloseLook.run` gives them. Raises ModelError
    if a network does not run.
    """
    # Each pass has its network: first those of the glance, then those of the look.
    chain = chain_of(look)
    networks = [each for each in chain for _ in range(each.contract.passes)]
    answers = np.zeros((len(places), 4), dtype=np.float32)
    worth = np.arange(len(places))
    for number, network in enumerate(networks):
        rules = _rules_of(network.contract)
        if number:
            worth = worth[answers[worth, 0] > rules.worth]
        if not len(worth):
            break
        # Several proposals move to the same object, and a wide patch takes long: one for each object is enough.
        asked = worth
        best = _most_probable_near(places, asked, answers[asked, 0]) if network.contract.is_wide else asked
        worth = np.unique(best)
        found = network.run(places.cut(worth, network.contract))
        last = _is_last(places, worth, networks[number + 1 :])
        low, high = rules.doubtful
        doubtful = np.flatnonzero(last & (found[:, 0] > low) & (found[:, 0] < high))
        if number and len(doubtful):
            found[doubtful] = _second_opinion(places, worth[doubtful], network, rules.zooms, found[doubtful])
        # A glance, the first of several networks, knows too little for a mean.
        was_glance = len(chain) > 1 and networks[number - 1] is chain[0]
        if number > 1 and not was_glance:
            both = np.stack([answers[worth[last], 0], found[last, 0]])
            found[last, 0] = _mean_odds(both, [_EARLIER, 1.0 - _EARLIER])
        answers[worth] = found
        answers[asked, 0] = np.minimum(answers[asked, 0], answers[best, 0])
        possible = places.move(worth, found[:, 1].astype(np.float64), found[:, 2].astype(np.float64))
        worth = worth[possible & ~last]
    return answers


def _most_probable_near(places: Places, rows: Chosen, probabilities: Singles) -> Chosen:
    """The most probable place (k,) that shows the same object as each place with the numbers `rows` (k,)."""
    near = places.near(rows)
    chosen = best_apart(probabilities, near, len(rows))
    return np.asarray(rows[chosen][near[chosen].argmax(axis=0)])


def _is_last(places: Places, rows: Chosen, following: Sequence[Look]) -> Mask:
    """Which places with the numbers `rows` (k,) none of the following passes can judge."""
    if following and following[0].contract.is_wide:
        return places.radii(rows) >= _LARGE
    return np.full(len(rows), not following)


def _mean_odds(probabilities: Singles, weights: Sequence[float]) -> Floats:
    """Probabilities (n,) whose log-odds are the weighted mean of those of (k, n). weights (k,): with the sum 1."""
    likely = _possible(probabilities)
    yes, no = (np.prod(each ** np.array(weights)[:, None], axis=0) for each in (likely, 1.0 - likely))
    return np.asarray(yes / (yes + no))


def _possible(probabilities: Singles) -> Floats:
    """Probabilities of any shape, neither 0 nor 1."""
    return np.clip(probabilities.astype(np.float64), 1.0 - _SUREST, _SUREST)


def _log_odds(probabilities: Singles) -> Floats:
    """Log-odds of probabilities (n,)."""
    likely = _possible(probabilities)
    return np.asarray(np.log(likely / (1.0 - likely)))


def _second_opinion(places: Places, rows: Chosen, look: Look, zooms: tuple[float, ...], answers: Singles) -> Singles:
    """Mean of the answers (k, 4) to k patches, and to mirror images of smaller and larger ones.

    All show the same object, but the network makes different errors on them. Probabilities are averaged as log-odds.
    """
    patches = np.concatenate([places.cut(rows, look.contract, zoom)[:, :, ::-1] for zoom in zooms])
    mirrored = look.run(patches).reshape(len(zooms), len(rows), 4)
    for zoom, each in zip(zooms, mirrored, strict=True):
        each[:, 1:3] *= -zoom, zoom
        each[:, 3] += math.log(zoom)
    opinions = np.concatenate([answers[None], mirrored])
    mean = opinions.mean(axis=0)
    mean[:, 0] = _mean_odds(opinions[..., 0], [1.0 / len(opinions)] * len(opinions))
    return np.asarray(mean, dtype=np.float32)


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
