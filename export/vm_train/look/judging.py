"""What the mesh network and its close look together find in the validation pictures, as on a robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Floats, Mask
from vm_embedded.detection.looking import look_closely
from vm_embedded.detection.observation import Stopwatch
from vm_embedded.detection.patches import Tangents
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError, InputError
from vm_embedded.network.look_contract import LookContract
from vm_export.look_network import LookNetwork
from vm_workstation.worker_process import results_of

from ..scores.calibration import logits_from
from .labels import OBJECT, UNLABELED, VISIBLE, label_places
from .observing import Observer, RunPicture, items_of
from .run import LookRun
from .torch_look import TorchLook


@dataclass(frozen=True, eq=False)
class Found:
    """n objects that were found in pictures: logits (n,) before the calibration, and whether each is right (n,).

    objects: number of true objects that are visible. pictures: number of pictures.
    """

    logits: Floats
    right: Mask
    objects: int
    pictures: int

    @classmethod
    def joined(cls, parts: Sequence[Found]) -> Found:
        """All objects of several parts."""
        return cls(
            np.concatenate([np.empty(0), *(each.logits for each in parts)]),
            np.concatenate([np.empty(0, dtype=np.bool_), *(each.right for each in parts)]),
            sum(each.objects for each in parts),
            sum(each.pictures for each in parts),
        )


@dataclass(frozen=True, eq=False)
class Judge:
    """Finds the objects in a picture."""

    observer: Observer
    look: TorchLook
    settings: Settings

    @classmethod
    def of(cls, run: LookRun, network: LookNetwork, contract: LookContract) -> Judge:
        """The judge of a run. network: not calibrated yet. Raises InputError or ModelError."""
        settings = Settings(max_proposals=run.configuration.patches.proposals, min_confidence=0.0)
        return cls(Observer.of(run), TorchLook(network, contract, TorchLook.of(run.glance())), settings)

    def __call__(self, item: RunPicture) -> Found:
        """The objects in a picture; none if it can't be used."""
        try:
            seen = self.observer.observe(item.files)
        except (InputError, GeometryError):  # was reported when the patches were collected
            return Found(np.empty(0), np.empty(0, dtype=np.bool_), 0, 0)
        judged = look_closely(seen.observation, self.look, seen.probabilities, self.settings, Stopwatch())
        kept = sorted((each for each in judged if each.reason is None), key=lambda each: -each.confidence)
        centers = np.array([each.center for each in kept]).reshape(-1, 3)
        found = label_places(Tangents.at(seen.observation.view, centers), seen.truths)
        logits = logits_from(np.array([each.confidence for each in kept], dtype=np.float64))
        counted = (found.labels != UNLABELED) & ~shown_before(found.of)
        visible = int((seen.truths.visible >= VISIBLE).sum())
        return Found(logits[counted], found.labels[counted] == OBJECT, visible, 1)


def shown_before(objects: npt.NDArray[np.int64]) -> Mask:
    """Which of n places show an object that a place before them shows, too: a robot reports one place of each.

    objects (n,): number of the object at each place, -1 without one.
    """
    again = objects >= 0
    again[np.unique(objects, return_index=True)[1]] = False
    return again


def judge_validation(
    run: LookRun, network: LookNetwork, contract: LookContract, workers: int, report: Callable[[int], None]
) -> Found:
    """What is found in the validation pictures of a run, with so many processes; 1 uses only this process.

    report: is called with the number of pictures that are done. Raises InputError and VisualMeshError.
    """
    items = [each for each in items_of(run) if each.validates]
    parts: list[Found] = []
    with closing(results_of(partial(Judge.of, run, network, contract), items, workers)) as results:
        for part in results:
            parts.append(part)
            report(len(parts))
    return Found.joined(parts)
