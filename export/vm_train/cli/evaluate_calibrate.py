"""vm-evaluate calibrate: a model file whose confidence fits what it finds in pictures."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vm_embedded.cli.program import EXIT_OK
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError, ModelError
from vm_embedded.files import check_writable
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model

from .evaluating import evaluate_with_progress, other_radii

if TYPE_CHECKING:
    from vm_export.look_checkpoint import LookCheckpoint

    from ..data.picture_files import PictureFiles
    from ..evaluation.evaluation import Evaluation
    from ..evaluation.workers import Job
    from ..scores.calibration import Calibration
    from ..scores.object_ranking import Ranking

_FEWEST = 10
"""Right and wrong answers that a calibration needs, of each."""

_CANDIDATES = Settings(min_confidence=0.01)
"""Accept what may be an object. Less likely answers are too many to let the others count."""

_OVERLAP = 0.5
"""IoU of a right answer."""

_MESH_WEIGHTS = (0.0, 0.4, 0.8, 1.6)
"""Weights of the scores of peaks that are tried beside a close look."""


def run_calibrate(options: argparse.Namespace) -> int:
    """Find objects in the pictures, fit the confidence, write the model file, and return the exit status.

    Raises InputError for too few answers and for what can't be read or written, and ModelError for a file without
    peaks.
    """
    # Imported here: without torch, help works and the error is one clear line.
    from vm_export.change_model import change_confidence, lost_canary_message
    from vm_export.look_weights import look_of

    from ..evaluation.evaluation import Rules
    from ..evaluation.mask_colors import classes_with_colors, default_colors
    from ..evaluation.picture_selection import select_pictures
    from ..evaluation.workers import Job

    path = model_path(options.model)
    if options.output.suffix != ".onnx":
        raise InputError(f"{options.output} must end in .onnx: it becomes a model file")
    check_writable(options.output, (path, options.list))
    model = read_model(path)
    if not model.manifest.peaks:
        raise ModelError(f"{path} has no peaks: only their confidence, and that of close looks, can be calibrated")
    pictures = select_pictures(options.data, options.list, options.part)
    classes = classes_with_colors(model.manifest, default_colors(path, options.list), options.color)
    rules = Rules(options.radius_of, options.strict)
    job = Job(path, _CANDIDATES, False, classes, rules)
    look = look_of(model)
    tries = _tries(look, job, pictures, options.workers)
    if options.radius_of == "all":
        for note in other_radii(tries[0], model.manifest.object_radius):
            print(f"vm-evaluate: {note}", file=sys.stderr)
    scores = {}
    for name in model.manifest.peaks:
        precisions = [_ranking(result, name).precision_recall.average_precision for result in tries]
        judged = look is not None and name in look.contract.names
        best = precisions.index(max(precisions)) if judged else 0
        fitted, source = _calibration(name, tries[best])
        if look is not None and judged:
            look = look.recalibrated(name, fitted.scale, fitted.offset, source, _MESH_WEIGHTS[best])
            for weight, precision in zip(_MESH_WEIGHTS, precisions, strict=True):
                print(f"{name}: average precision {precision:.4f} with a mesh weight of {weight:g}")
        else:
            scores[name] = fitted.scale, fitted.offset
    lost_canary = change_confidence(path, options.output, look, scores)
    print(f"{options.output}: written; other objects may now pass --min-confidence")
    if lost_canary:
        print(f"vm-evaluate: {lost_canary_message(options.output, options.model)}", file=sys.stderr)
    return EXIT_OK


def _ranking(result: Evaluation, name: str) -> Ranking:
    """What was found of a class."""
    if name in result.objects:
        return result.objects[name].ranking(_OVERLAP)
    if result.features is None:
        raise InputError(f"{name} needs pictures with the classes of a field to be calibrated")
    return (result.features.posts if name == "goal" else result.features.robots).ranking()


def _tries(
    look: LookCheckpoint | None, job: Job, pictures: Sequence[PictureFiles], workers: int | None
) -> list[Evaluation]:
    """What is found with each weight of the peaks' scores; without a look, once."""
    from vm_export.change_model import change_confidence

    found: list[Evaluation] = []
    with tempfile.TemporaryDirectory() as folder:
        for weight in (0.0,) if look is None else _MESH_WEIGHTS:
            path = Path(folder) / "weighted.onnx"
            change_confidence(job.model, path, look and look.weighted(weight), {})
            tried = replace(job, model=path)
            found.append(evaluate_with_progress(tried, tried.subject(), pictures, workers))
    return found


def _calibration(name: str, result: Evaluation) -> tuple[Calibration, str]:
    """The scale and offset of a class's confidence that fit what was found, and a text about that; print how well the
    confidence fits before and after."""
    from ..scores.calibration import Calibration, Reliability, logits_from

    ranking = _ranking(result, name)
    confidence, right = ranking.confidence, ranking.right
    count = int(right.sum())
    if min(count, len(right) - count) < _FEWEST:
        raise InputError(
            f"class {name}: {count} right and {len(right) - count} wrong answers are too few for a calibration, which "
            f"needs {_FEWEST} of each: give more pictures"
        )
    logits = logits_from(confidence)
    fitted = Calibration.fit(logits, right)
    before, after = (Reliability.of(each, right).error for each in (confidence, fitted.probabilities(logits)))
    source = f"{len(right)} answers in {len(result.poses)} pictures"
    print(
        f"{name}: {source}; expected calibration error {before:.3f} before, {after:.3f} after "
        f"(scale {fitted.scale:.2f}, offset {fitted.offset:+.2f} of the logit)"
    )
    if after >= before:
        print(f"vm-evaluate: class {name}: the error is not smaller than before: give more pictures", file=sys.stderr)
    return fitted, source
