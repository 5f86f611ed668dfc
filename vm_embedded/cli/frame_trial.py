"""The trial of vm-doctor: what the detector sees in frames of the user's own, in a process with limits.

The network may be hostile, and root may run vm-doctor: so the frames go to the process that also proves models.
"""

from __future__ import annotations

import asyncio
import pickle
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..arrays import Image
from ..borders.text import printable
from ..detection.detector import Detector
from ..detection.pose_check import PoseCheck
from ..detection.settings import Settings
from ..errors import ModelError, VisualMeshError
from ..geometry.lens import Lens
from ..geometry.orientation import Orientation
from ..live.proving_process import answer_limited, ask_limited_process
from ..network.model_file import ModelFile, parse_model
from .closing_remarks import ClosingRemarks
from .finding import BAD, GOOD, WARNING, Finding

_VIEWS = 2
"""Frames in which a better pose is sought: the time of the process is limited."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A frame of the user's, with its lens and pose. source: its name. is_users: the pose is the one that the user gave
    for all frames."""

    source: str
    image: Image
    lens: Lens
    orientation: Orientation
    is_users: bool


def check_detection(model: ModelFile, settings: Settings, samples: Sequence[Sample]) -> Finding:
    """How many points, proposals and objects the detector sees in some frames, and what is strange about them."""
    content = pickle.dumps((model.content, settings, list(samples)))
    frames = "the frame" if len(samples) == 1 else f"each of {len(samples)} frames"
    try:
        answer = asyncio.run(ask_limited_process("vm_embedded.cli.frame_trial", model.path, content))
        seen, remarks = f"{frames} has {_in_words(answer)}", [printable(str(each)) for each in answer["remarks"]]
    except VisualMeshError as error:
        return Finding("detection", BAD, str(error), "see lens and pose above; vm-detect on the same frames tells more")
    except (KeyError, TypeError, ValueError):
        return Finding("detection", BAD, f"{model.path} gave an unexpected answer", "export the model again")
    if remarks:
        return Finding("detection", WARNING, seen, "; ".join(remarks))
    return Finding("detection", GOOD, seen)


def _in_words(answer: dict[str, Any]) -> str:
    """Ranges over the frames. Raises KeyError, TypeError or ValueError for an answer that is none."""
    objects = ", ".join(_range([int(each) for each in counts], printable(name)) for name, counts in answer["objects"])
    points, proposals = ([int(each) for each in answer[name]] for name in ("points", "proposals"))
    return ", ".join(filter(None, [_range(points, "points"), _range(proposals, "proposals"), objects]))


def _range(counts: Sequence[int], name: str) -> str:
    low, high = min(counts), max(counts)
    return f"{low} {name}" if low == high else f"{low} to {high} {name}"


def main(path: str) -> None:
    """The child: search the frames on standard input."""
    answer_limited(path, lambda content: _searched(path, content))


def _searched(path: str, content: bytes) -> dict[str, Any]:
    """For each frame: points, proposals and objects by class; and the remarks on all of them."""
    model, settings, samples = pickle.loads(content)  # the parent wrote it; the model in it is only bytes
    detector = Detector(parse_model(path, model), settings)
    remarks, check, found = ClosingRemarks(detector, _VIEWS), PoseCheck(), []
    for each in samples:
        try:
            detections = check.update(detector.detect(each.image, each.orientation, each.lens, explain=True))
        except VisualMeshError as error:
            raise ModelError(f"{each.source}: {error}") from error
        remarks.add(each.source, each.image, each.lens, each.orientation, detections, each.is_users)
        found.append(detections)
    names = [each.name for each in detector.manifest.classes if each.kind == "object"]
    return {
        "points": [len(each.pixels) for each in found],
        "proposals": [len(each.objects) + len(each.rejected) for each in found],
        "objects": [[name, [sum(one.class_name == name for one in each) for each in found]] for name in names],
        "remarks": list(remarks.lines()),
    }


if __name__ == "__main__":
    main(sys.argv[1])
