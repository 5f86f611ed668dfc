"""Evaluation in several processes, one core each. Their number does not change the result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vm_embedded.detection.settings import Settings
from vm_workstation.worker_process import results_of

from ..data.classes import Classes
from ..data.picture_files import PictureFiles
from .answers import Subject, load_subject
from .evaluation import Evaluation, Rules, evaluate_pictures

_FEWEST, _CHUNK = 16, 32
"""Pictures that a worker evaluates at a time. Adding up two results costs about as much as one picture, and starting a
worker as much as about ten: it loads the network and its libraries."""


@dataclass(frozen=True)
class Job:
    """What each worker process needs. model: a .pt or .onnx file."""

    model: Path
    settings: Settings
    as_robot: bool
    classes: Classes
    rules: Rules

    def subject(self) -> Subject:
        """The network to evaluate. Raises InputError or ModelError."""
        return load_subject(self.model, self.settings, self.as_robot)


def evaluate(
    job: Job, subject: Subject, pictures: Sequence[PictureFiles], workers: int, report: Callable[[], None]
) -> Evaluation:
    """The result for all pictures, from so many processes; 1 uses only this process.

    report: is called after each picture. Raises the errors of `evaluate_pictures`, and VisualMeshError if a worker was
    killed.
    """
    size = min(_CHUNK, max(-(-len(pictures) // workers), _FEWEST))
    chunks = [pictures[start : start + size] for start in range(0, len(pictures), size)]
    result = Evaluation.empty(subject)
    for part, chunk in zip(_parts(job, subject, chunks, workers), chunks, strict=True):
        result += part
        for _ in chunk:
            report()
    return result


def _parts(job: Job, subject: Subject, chunks: Sequence[Sequence[PictureFiles]], workers: int) -> Iterator[Evaluation]:
    if workers == 1 or len(chunks) < 2:
        return map(_evaluator(job, subject), chunks)
    return results_of(partial(_loaded_evaluator, job), chunks, workers, chunk=1)


def _evaluator(job: Job, subject: Subject) -> Callable[[Sequence[PictureFiles]], Evaluation]:
    """Evaluates pictures. subject: the network of the job."""
    return lambda pictures: evaluate_pictures(subject, pictures, job.classes, job.rules)


def _loaded_evaluator(job: Job) -> Callable[[Sequence[PictureFiles]], Evaluation]:
    """The same in a worker process, which loads the network itself."""
    return _evaluator(job, job.subject())
