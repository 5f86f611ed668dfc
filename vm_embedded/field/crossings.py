"""Crossings: where two straight lines meet at a right angle, and in which shape.

Places and directions on the plane are complex numbers here: of conj(a) b, the real part is the scalar product of a and
b, and the imaginary part is their cross product.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from itertools import combinations, compress
from typing import NamedTuple

import numpy as np

from .features import Crossing
from .lines import Piece

_MARGIN = 0.25
"""A line that goes on by less than this behind a crossing [m] ends there."""

_MISSING = 0.35
"""A line may end so far in front of a crossing [m]."""

_LARGER = 0.05
"""Both grow by this share of the distance."""

_LEAST_SINE = 0.9
"""Sine of the angle between two lines that cross, at least; cosine of the angle between two parallel ones."""

_GAP_COST = 0.5
"""Share of a crossing's confidence that is lost if a line ends as far in front of it as it may."""


class _Line(NamedTuple):
    """A straight piece of a line: its start [m], its direction of length 1, its length [m] and its confidence."""

    start: complex
    way: complex
    length: float
    confidence: float

    def arms(self, t: float, beyond: float) -> list[complex]:
        """The directions in which it goes on from a place at t [m] along it, by more than `beyond` [m]."""
        return [way for way, rest in ((self.way, self.length - t), (-self.way, t)) if rest > beyond]


Possible = tuple[Crossing, complex, complex]
"""A crossing, and two places [m] that the frame must show to be sure that its lines end."""


def possible_crossings(pieces: Sequence[Piece], confidences: Sequence[float]) -> list[Possible]:
    """The crossings of all pairs of straight pieces of lines.

    confidences: of the pieces.
    """
    found = []
    for one, other in combinations(_without_duplicates(pieces, confidences), 2):
        sine = (one.way.conjugate() * other.way).imag
        if abs(sine) > _LEAST_SINE:
            found.append(_crossing(one, other, sine))
    return [each for each in found if each is not None]


def certain_crossings(crossings: Sequence[Crossing], complete: Sequence[bool]) -> tuple[Crossing, ...]:
    """Those crossings whose kind is clear. It is not where the frame ends behind the end of a line, or where lines of
    several pieces meet.

    complete: whether the frame shows both places behind each crossing.
    """
    whole = list(compress(crossings, complete))
    return tuple(each for each in whole if _is_alone(each, whole))


def _without_duplicates(pieces: Sequence[Piece], confidences: Sequence[float]) -> list[_Line]:
    """The lines, longest first.

    A line that was found twice, as two lines beside each other, is one: the longer, with the ends of both.
    """
    kept: list[_Line] = []
    for each, confidence in sorted(zip(pieces, confidences, strict=True), key=lambda each: -each[0].length):
        length = each.length
        start, end = (complex(*place) for place in each.ends.tolist())
        for number, longer in enumerate(kept):
            # Both ends, as seen from the start of the longer one: the real part is along it.
            turn = longer.way.conjugate()
            first, last = (start - longer.start) * turn, (end - longer.start) * turn
            low, high = sorted((first.real, last.real))
            is_parallel = high - low > _LEAST_SINE * length
            is_beside = abs(first.imag + last.imag) < 2.0 * _MARGIN + 0.5 * _LARGER * abs(start + end)
            if is_parallel and is_beside and high > 0.0 and low < longer.length:
                low, high = min(low, 0.0), max(high, longer.length)
                kept[number] = longer._replace(start=longer.start + low * longer.way, length=high - low)
                break
        else:
            kept.append(_Line(start, (end - start) / length, length, confidence))
    return kept


def _crossing(one: _Line, other: _Line, sine: float) -> Possible | None:
    """The crossing of two lines, if they meet. sine: of the angle between them."""
    between = (other.start - one.start).conjugate()
    t, u = (between * other.way).imag / sine, (between * one.way).imag / sine  # [m] along both
    place = one.start + t * one.way
    beyond, missing = (each + _LARGER * abs(place) for each in (_MARGIN, _MISSING))
    gap = max(-t, t - one.length, -u, u - other.length, 0.0) / missing  # of a line in front of the other
    if gap >= 1.0:
        return None
    arms = sorted([one.arms(t, beyond), other.arms(u, beyond)], key=len)
    if not arms[0]:
        return None
    kind = {2: "L", 3: "T", 4: "X"}[len(arms[0]) + len(arms[1])]
    heading = cmath.phase(arms[0][0] + arms[1][0] if kind == "L" else arms[0][0])
    crossing = Crossing(
        kind,
        np.array([place.real, place.imag]),
        heading % (0.5 * math.pi) if kind == "X" else heading,
        one.confidence * other.confidence * (1.0 - _GAP_COST * gap),
    )
    first, second = (place - own[0] * beyond if len(own) == 1 else place for own in arms)
    return crossing, first, second


def _is_alone(crossing: Crossing, others: Sequence[Crossing]) -> bool:
    """Whether no other crossing is at the same place. Of a line in two pieces, each makes one, and none is right."""
    return sum(math.dist(each.position, crossing.position) < 2.0 * _MARGIN for each in others) == 1
