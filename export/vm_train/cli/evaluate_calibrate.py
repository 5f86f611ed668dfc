"""vm-evaluate calibrate: a model file whose confidence fits what it finds in pictures."""

from __future__ import annotations

import argparse

from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.files import check_writable
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model

from .evaluating import evaluate_with_progress

EXIT_OK = 0

_FEWEST = 10
"""Right and wrong answers that a calibration needs, of each."""

_CANDIDATES = Settings(min_confidence=0.01)
"""Accept what may be an object. Less likely answers are too many to let the others count."""

_OVERLAP = 0.5
"""IoU of a right answer."""


def run_calibrate(options: argparse.Namespace) -> int:
    """Find objects in the pictures, fit the confidence, write the model file, and return the exit status.

    Raises InputError for too few answers and for what can't be read or written, and ModelError for a file without a
    close look.
    """
    # Imported here: without torch, help works and the error is one clear line.
    from vm_export.change_model import change_look
    from vm_export.look_weights import look_of

    from ..evaluation.evaluation import Rules
    from ..evaluation.mask_colors import classes_with_colors, default_colors
    from ..evaluation.picture_selection import select_pictures
    from ..evaluation.workers import Job
    from ..scores.calibration import Calibration, Reliability, logits_from

    path = model_path(options.model)
    if path.resolve() == options.output.resolve():
        raise InputError(f"{path} is the input and would be overwritten; give another file with --output")
    check_writable(options.output)
    model = read_model(path)
    look = look_of(model)
    pictures = select_pictures(options.data, options.list, options.part)
    classes = classes_with_colors(model.manifest, default_colors(path, options.list), options.color)
    rules = Rules(options.radius_of, options.min_radius, options.strict)
    job = Job(path, _CANDIDATES, False, classes, rules)
    result = evaluate_with_progress(job, job.subject(), pictures, options.workers)
    name = look.contract.object_class
    answers = result.objects[name].ranking(_OVERLAP)
    right, wrong = int(answers.right.sum()), int((~answers.right).sum())
    if min(right, wrong) < _FEWEST:
        raise InputError(
            f"{right} right and {wrong} wrong answers are too few for a calibration, which needs {_FEWEST} of each: "
            "give more pictures"
        )
    logits = logits_from(answers.confidence)
    fitted = Calibration.fit(logits, answers.right)
    after = Reliability.of(fitted.probabilities(logits), answers.right).error
    source = f"{right + wrong} answers in {answers.pictures} pictures"
    change_look(path, options.output, look.recalibrated(fitted.scale, fitted.offset, source))
    print(
        f"{name}: {source}; expected calibration error {answers.reliability.error:.3f} before, {after:.3f} after "
        f"(scale {fitted.scale:.2f}, offset {fitted.offset:+.2f} of the logit)"
    )
    print(f"{options.output}: written")
    return EXIT_OK
