"""The settings of an evaluation, its progress bar, and a line for each skipped picture."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from vm_embedded.cli.progress import ProgressBar
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
from vm_embedded.live.configuration import read_configuration

if TYPE_CHECKING:
    from ..data.picture_files import PictureFiles
    from ..evaluation.answers import Subject
    from ..evaluation.evaluation import Evaluation
    from ..evaluation.workers import Job


def detector_settings(options: argparse.Namespace) -> Settings:
    """The settings of --config, and of the options, which override them. Raises InputError."""
    configured = read_configuration(options.config).detector if options.config else Settings()
    given = {each.name: getattr(options, each.name, None) for each in fields(Settings) if each.name != "format"}
    chosen = {name: value for name, value in given.items() if value is not None}
    return replace(configured, **chosen, format="bgr")


def evaluate_with_progress(
    job: Job, subject: Subject, pictures: Sequence[PictureFiles], workers: int | None
) -> Evaluation:
    """The result for the pictures, from so many processes; None: one for each core.

    Raises the errors of `workers.evaluate`, and InputError if no picture could be evaluated.
    """
    from ..evaluation.workers import evaluate  # here, so that help works without torch

    bar = ProgressBar(len(pictures), "vm-evaluate")
    try:
        result = evaluate(job, subject, pictures, workers or len(os.sched_getaffinity(0)), bar.advance)
    finally:
        bar.clear()
    for path, fault in result.faults.items():
        print(f"vm-evaluate: skipped {path}: {fault}", file=sys.stderr)
    if not result.poses:
        raise InputError("no picture could be evaluated")
    return result


def other_radii(result: Evaluation, radius: float) -> list[str]:
    """A remark if the objects in the pictures have other radii than the detector expects [m]."""
    if not any(abs(each - radius) > 0.02 * radius for each in result.radii):
        return []
    low, high = min(result.radii), max(result.radii)
    found = f"radii from {low:.3f} to {high:.3f} m" if high > low else f"a radius of {low:.3f} m"
    return [
        f"The objects in these pictures have {found}, but the detector expects {radius:g} m. --radius-of scene uses "
        "the radius of each picture's object."
    ]
