"""What the mesh network and its close look together find in the validation pictures, as on a robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import count

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Mask
from vm_embedded.detection.looking import Judgment, judge_peaks
from vm_embedded.detection.observation import Stopwatch
from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.network.look_contract import LookContract
from vm_export.look_network import LookNetwork
from vm_workstation.worker_process import results_of

from ..scores.calibration import logits_from
from ..scores.object_ranking import Ranking
from .labels import OBJECT, UNLABELED, label_places
from .observing import Observed, Observer, RunPicture, items_of
from .run import LookRun
from .torch_look import TorchLook


@dataclass(frozen=True, eq=False)
class Judge:
    """Finds the objects in a picture."""

    observer: Observer
    look: TorchLook
    settings: Settings

    @classmethod
    def of(cls, run: LookRun, network: LookNetwork, contract: LookContract) -> Judge:
        """The judge of a run. network: not calibrated yet. Raises InputError or ModelError."""
        return cls(Observer.of(run), TorchLook(network, contract), Settings(min_confidence=0.0))

    def __call__(self, item: RunPicture) -> list[Ranking]:
        """The objects of each class in a picture, with logits before the calibration; none if it can't be used."""
        try:
            observation, classes = self.observer.observe(item.files)
        except (InputError, GeometryError):  # was reported when the patches were collected
            return [Ranking.empty() for _ in self.look.contract.classes]
        judged = judge_peaks(observation, [each.sought for each in classes], self.look, self.settings, Stopwatch())
        return [_ranked(*each) for each in zip(classes, judged, strict=True)]


def _ranked(seen: Observed, judged: Sequence[Judgment]) -> Ranking:
    """The objects of a class in a picture, with logits."""
    kept = sorted((each for each in judged if each.reason is None), key=lambda each: -each.confidence)
    centers = np.array([each.center for each in kept]).reshape(-1, 3)
    found = label_places(Tangents.at(seen.view, centers), seen.truths)
    logits = logits_from(np.array([each.confidence for each in kept], dtype=np.float64))
    counted = (found.labels != UNLABELED) & ~shown_before(found.of)
    right = found.labels[counted] == OBJECT
    return Ranking(confidence=logits[counted], right=right, truths=seen.visible, pictures=1)


def shown_before(objects: npt.NDArray[np.int64]) -> Mask:
    """Which of n places show an object that a place before them shows, too: a robot reports one place of each.

    objects (n,): number of the object at each place, -1 without one.
    """
    again = objects >= 0
    again[np.unique(objects, return_index=True)[1]] = False
    return again


def judge_validation(
    run: LookRun, network: LookNetwork, contract: LookContract, workers: int, report: Callable[[int], None]
) -> list[Ranking]:
    """What is found of each class in the validation pictures of a run, with logits.

    workers: processes; 1 uses only this process. report: is called with the number of pictures that are done. Raises
    InputError and VisualMeshError.
    """
    items = [each for each in items_of(run) if each.validates]
    found, done = [Ranking.empty() for _ in contract.classes], count(1)
    with closing(results_of(partial(Judge.of, run, network, contract), items, workers)) as results:
        for parts in results:
            found = [before + part for before, part in zip(found, parts, strict=True)]
            report(next(done))
    return found
