"""What stands at the peaks of a network: the objects and uprights of all its classes, judged together."""

from __future__ import annotations

from collections.abc import Mapping

from ..field.features import UPRIGHTS
from .looking import Judgment, Look, Sought, judge_peaks
from .observation import Observation
from .settings import Settings
from .stopwatch import Stopwatch
from .upright_bases import sought_bases

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
