"""The report of a fine-tuning: what the network found in the frames for validation before and after it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape

import cv2
import numpy as np
import numpy.typing as npt

from vm_embedded.arrays import Image
from vm_embedded.cameras.image_files import read_image
from vm_embedded.files import write_file

from ..boxes.box import BoxedPicture
from ..evaluation.html_page import html_page, html_strip, html_table
from .run_folder import TuningRun
from .window_scores import PASSING, REPORTED, Looked, WindowScores

REPORT = "report.html"
"""Name of the file, the last one that a fine-tuning writes."""

_SHOWN = 24
"""Crops in a strip."""

_SIDE = 120
"""Side of a crop [px]."""

_REACH = 3.0
"""Half the side of a crop [radii]."""

_COLOR = (60, 60, 230)


def write_report(run: TuningRun, before: WindowScores, after: WindowScores) -> None:
    """Write report.html of a run. Raises InputError if it can't be written."""
    frames = run.part(run.split.validation)
    write_file(run.folder / REPORT, _page(run, frames, before, after))


def _page(run: TuningRun, frames: list[BoxedPicture], before: WindowScores, after: WindowScores) -> str:
    name = run.object_class
    recordings = len({each.recording for each in frames})
    about = f"The close look of {run.model} learned from {len(run.split.training)} frames of {run.boxes.folder.name}."
    if frames:
        about += f" These scores are of {len(frames)} other frames, from {recordings} other recordings."
    parts = [f"<h1>{escape(run.boxes.folder.name)}: {escape(name)}</h1>", f"<p>{escape(about)}</p>"]
    if not frames:
        parts.append(
            '<p class="note">No recording is small enough to be kept for validation, so nothing was measured. Record '
            "several times, and put the frames of each recording into a folder of its own.</p>"
        )
        return html_page(f"vm-train look: {run.boxes.folder.name}", parts)
    heading, rows = _table(before, after)
    parts.append(html_table(heading, rows))
    missed = after.boxes.probabilities < REPORTED
    lost = missed & (before.boxes.probabilities >= REPORTED)
    strips = {
        f"Boxes of {name} that are missed": (after.boxes, missed & ~lost),
        f"Boxes of {name} that only the network before found": (after.boxes, lost),
        "Found beside all boxes: false, or without a box": (after.others, after.others.probabilities >= REPORTED),
    }
    for title, (looked, chosen) in strips.items():
        if chosen.any():
            parts.append(f"<h2>{escape(title)}: {int(chosen.sum())}</h2>")
            parts.append(html_strip(list(_crops(frames, looked, chosen))))
    return html_page(f"vm-train look: {run.boxes.folder.name}", parts)


def _table(before: WindowScores, after: WindowScores) -> tuple[list[str], list[list[str]]]:
    def row(name: str, score: WindowScores) -> list[str]:
        count = len(score.boxes.probabilities)
        return [
            name,
            f"{score.reported} of {count}",
            f"{score.false} of {len(score.others.probabilities)}",
            "-" if math.isnan(score.recall) else f"{100.0 * score.recall:.0f} %",
        ]

    heading = [
        "Network",
        f"Boxes found with a probability of at least {REPORTED:g}",
        "Other places taken for the object",
        f"Boxes found if 1 of {PASSING} other places passes",
    ]
    return heading, [row("before", before), row("after", after)]


def _crops(frames: list[BoxedPicture], looked: Looked, chosen: npt.NDArray[np.bool_]) -> Iterator[tuple[bytes, str]]:
    """Pictures around windows, the most probable first, and their captions."""
    rows = np.flatnonzero(chosen)
    for row in rows[np.argsort(-looked.probabilities[rows], kind="stable")][:_SHOWN]:
        frame = frames[looked.frames[row]]
        crop = _crop(read_image(frame.image), looked.windows.centers[row].tolist(), float(looked.windows.radii[row]))
        jpeg = cv2.imencode(".jpg", crop, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
        yield jpeg, f"{looked.probabilities[row]:.2f}, {frame.image.stem}"


def _crop(image: Image, center: tuple[float, float], radius: float) -> Image:
    """The surroundings of a window, with its outline."""
    scale = _SIDE / (2.0 * _REACH * radius)
    middle = 0.5 * _SIDE - 0.5
    moved = np.array([[scale, 0.0, middle - scale * center[0]], [0.0, scale, middle - scale * center[1]]])
    crop = cv2.warpAffine(image, moved, (_SIDE, _SIDE), flags=cv2.INTER_LINEAR)
    at = round(middle)
    cv2.circle(crop, (at, at), round(scale * radius), _COLOR, 1, cv2.LINE_AA)
    return np.asarray(crop, dtype=np.uint8)
