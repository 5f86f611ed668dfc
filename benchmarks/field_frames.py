"""Field features on frames of others: robots and goal posts that people marked, and points that another network judged.

    python -m benchmarks.field_frames ../shared --model soccer

The folder holds two sets. `real`: `images/imageX.jpg` with `images/lensX.yaml`, and `boxes.json` with the boxes of each
frame: class and edges `x0`, `y0`, `x1`, `y1` [px]. `reference`: images and `golden/goldenX.npz` with rays and
probabilities of the authors' network. The network under test never learned from either.

The ray through the middle of a box's lower edge meets the plane at the front of the robot or post. That is the base of
a robot. The base of a post is half its width behind: the width between the rays through the ends of the lower edge. A
report is right if it is within 15 % of the distance of a base, or if its pixel is inside the box's foot: the lowest
fifth of the box, widened by a quarter of the box's width on each side and, because the edges are only good to some
pixels, by 4 px in all directions.

The place of a base is not known if it is in the lowest 2 % of the picture's rows, where the picture cuts it off, or if
another box covers it that reaches further down. Such a base can't be missed, and a report in its direction is neither
found nor false. Neither count bases and reports beyond the distance of interest. A report at a person counts as
`people`.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.detector import Detector
from vm_embedded.errors import InputError
from vm_embedded.field.features import Upright
from vm_embedded.geometry.lens_files import LensFile, read_lens_file
from vm_embedded.network.bundled import model_path
from vm_workstation.text_tables import aligned

KINDS = {"robots": "obstacle", "posts": "goal post"}
"""The class of a box, by the kind of a reported feature."""

PERSON = "human"

NOT_IN_FRONT = ("parking", "goal post", "ball")
"""Classes of boxes that hide little of what is behind them. A robot often has the ball at its foot."""

TOLERANCE = 0.15
"""Largest error of a base, as a share of its distance."""

_FOOT = 0.2
_WIDER = 0.25
_MARGIN = 4.0  # [px]
_CUT = 0.98

REFERENCE_CLASSES = ("ball", "goal", "line", "field", "environment")
"""Classes of the golden probabilities."""

COMPARED = ("field", "line")

_SAME = math.radians(1.5)
"""Largest angle between the rays of two points that are compared."""


@dataclass(frozen=True)
class Marked:
    """A box of a frame. position (2,) [m] on the plane: of its base, or None if the base is above the horizon or
    hidden. is_hidden: whether something in front or the edge of the picture hides it."""

    edges: tuple[float, float, float, float]
    position: Floats | None
    is_hidden: bool

    @property
    def distance(self) -> float:
        """Distance on the plane from the camera's foot [m]; infinite without a place."""
        return math.inf if self.position is None else math.hypot(*self.position)

    def error(self, found: Upright) -> float:
        """Distance between the places as a share of its own distance; infinite without a place."""
        if self.position is None:
            return math.inf
        return math.hypot(*(found.position - self.position)) / max(self.distance, 1e-6)

    def has_in_foot(self, found: Upright) -> bool:
        """Whether the pixel of a reported base is in the widened foot."""
        x0, y0, x1, y1 = self.edges
        side, up = _WIDER * (x1 - x0) + _MARGIN, _FOOT * (y1 - y0) + _MARGIN
        x, y = found.pixel
        return bool(x0 - side <= x <= x1 + side and y1 - up <= y <= y1 + _MARGIN)

    def is_same(self, found: Upright) -> bool:
        """Whether a report is right."""
        return self.error(found) <= TOLERANCE or self.has_in_foot(found)

    def is_above(self, found: Upright) -> bool:
        """Whether the box covers the columns of a reported base."""
        return bool(self.edges[0] - _MARGIN <= found.pixel[0] <= self.edges[2] + _MARGIN)


@dataclass
class Count:
    """Results for a kind of upright: found with their relative errors, missed and false ones, each as text."""

    found: list[float] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    false: list[str] = field(default_factory=list)
    people: list[str] = field(default_factory=list)

    def summary(self) -> dict[str, Any]:
        """Numbers for JSON."""
        return {
            "bases": len(self.found) + len(self.missed),
            "found": len(self.found),
            "false": len(self.false),
            "people": len(self.people),
            "error_median": round(float(np.median(self.found)), 4) if self.found else None,
        }


def marked(boxes: Sequence[Mapping[str, Any]], kind: str, lens: LensFile, size: tuple[int, int]) -> list[Marked]:
    """The boxes of a class. size: width and height of the picture [px]."""
    assert lens.orientation is not None
    found = []
    for each in boxes:
        if each["class"] != kind:
            continue
        edges = (float(each["x0"]), float(each["y0"]), float(each["x1"]), float(each["y1"]))
        hidden = edges[3] >= _CUT * size[1] or any(_hides(other, edges) for other in boxes)
        depth = 0.5 if kind == KINDS["posts"] else 0.0
        found.append(Marked(edges, None if hidden else _base(edges, lens, size, depth), hidden))
    return found


def _hides(other: Mapping[str, Any], edges: tuple[float, float, float, float]) -> bool:
    """Whether a box covers the middle of the lower edge of another one, and reaches further down."""
    x, y = (edges[0] + edges[2]) / 2.0, edges[3]
    covers = other["x0"] <= x <= other["x1"] and other["y0"] <= y + _MARGIN
    return bool(other["class"] not in NOT_IN_FRONT and covers and other["y1"] > y + _MARGIN)


def _base(
    edges: tuple[float, float, float, float], lens: LensFile, size: tuple[int, int], depth: float
) -> Floats | None:
    """Place (2,) [m] of the base of what fills a box; None above the horizon.

    depth: from the front of the foot to the base, as a share of the width.
    """
    assert lens.orientation is not None
    x0, _, x1, y1 = edges
    pixels = np.array([(x0, y1), ((x0 + x1) / 2.0, y1), (x1, y1)])
    rays = lens.lens.for_image(size).unproject(pixels, size) @ lens.orientation.rotation.T
    if not (np.isfinite(rays).all() and (rays[:, 2] < -1e-3).all()):
        return None
    left, front, right = rays[:, :2] * (-lens.orientation.height / rays[:, 2:])
    distance, width = math.hypot(*front), math.hypot(*(right - left))
    return np.asarray(front * (1.0 + depth * width / max(distance, 1e-6)))


def count_uprights(
    name: str, true: Sequence[Marked], people: Sequence[Marked], reports: Sequence[Upright], near: float, result: Count
) -> None:
    """Add a frame: its true uprights, its people and the reports. near [m]: distance of interest."""
    left, rest = list(true), []
    for report in sorted(reports, key=lambda each: min((box.error(each) for box in true), default=math.inf)):
        same = [each for each in left if each.is_same(report)]
        if same:
            best = min(same, key=lambda each: each.error(report))
            left.remove(best)
            if best.distance < near:
                result.found.append(best.error(report))
        else:
            rest.append(report)
    result.missed += [f"{name}: {_at(each.edges)}, {each.distance:.1f} m" for each in left if each.distance < near]
    for report in rest:
        where = math.hypot(*report.position)
        if where >= near or any(each.is_hidden and each.is_above(report) for each in true):
            continue
        text = f"{name}: at ({report.pixel[0]:.0f}, {report.pixel[1]:.0f}), {where:.1f} m, {report.confidence:.2f}"
        (result.people if any(each.is_same(report) for each in people) else result.false).append(text)


def _at(edges: tuple[float, float, float, float]) -> str:
    return f"at ({(edges[0] + edges[2]) / 2.0:.0f}, {edges[3]:.0f})"


def score(folder: Path, detector: Detector, near: float) -> dict[str, Count]:
    """Robots and goal posts in every frame of a folder, nearer than `near` [m]. Raises InputError for a network without
    field features."""
    boxes = json.loads((folder / "boxes.json").read_text())
    results = {kind: Count() for kind in KINDS}
    for path, lens, image in _frames(folder):
        assert lens.orientation is not None
        seen = detector.detect(image, lens.orientation, lens.lens).field
        if seen is None:
            raise InputError("the network has no classes for field features")
        size = (image.shape[1], image.shape[0])
        here = boxes.get(path.name, [])
        people = marked(here, PERSON, lens, size)
        for kind, reports in (("robots", seen.robots), ("posts", seen.posts)):
            # A post is never a person; a report there is simply false.
            persons = people if kind == "robots" else []
            count_uprights(path.name, marked(here, KINDS[kind], lens, size), persons, reports, near, results[kind])
    return results


def _frames(folder: Path) -> Iterator[tuple[Path, LensFile, Any]]:
    """The frames of a folder: path, lens and BGR image."""
    for path in sorted((folder / "images").glob("image*.jpg")):
        lens = read_lens_file(path.with_name(path.name.replace("image", "lens")).with_suffix(".yaml"))
        yield path, lens, read_image(path)


def against_golden(folder: Path, detector: Detector) -> dict[str, dict[str, float | None]]:
    """F1, precision and recall of the network's points, if the golden answers were the truth.

    Each of its points is compared with the nearest golden point, if one is within 1.5 degrees. A point belongs to a
    class if its probability is above 0.5.
    """
    columns = [REFERENCE_CLASSES.index(name) for name in COMPARED]
    own = [detector.manifest.column(name) for name in COMPARED]
    counts = np.zeros((len(COMPARED), 3), dtype=np.int64)  # hits, false, missed
    for path, lens, image in _frames(folder):
        assert lens.orientation is not None
        golden = np.load(folder / "golden" / f"{path.stem.replace('image', 'golden')}.npz")
        seen = detector.detect(image, lens.orientation, lens.lens)
        matches = nearest(seen.rays, golden["rays"].astype(np.float64))
        used = matches >= 0
        ours = seen.probabilities[used][:, own] > 0.5
        theirs = golden["probabilities"][matches[used]][:, columns] > 0.5
        counts += np.stack([(ours & theirs).sum(0), (ours & ~theirs).sum(0), (~ours & theirs).sum(0)], axis=1)
    return {name: _shares(*row) for name, row in zip(COMPARED, counts.tolist(), strict=True)}


def nearest(rays: Floats, others: Floats) -> np.ndarray[Any, np.dtype[np.intp]]:
    """For each unit ray (n, 3) the number of the nearest of the others (m, 3), or -1 if none is near enough."""
    cosines = rays @ others.T
    best = cosines.argmax(axis=1)
    return np.where(cosines[np.arange(len(rays)), best] >= math.cos(_SAME), best, -1)


def _shares(hits: int, false: int, missed: int) -> dict[str, float | None]:
    values = {
        "f1": (2 * hits, 2 * hits + false + missed),
        "precision": (hits, hits + false),
        "recall": (hits, hits + missed),
    }
    return {name: round(part / whole, 4) if whole else None for name, (part, whole) in values.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with the sets real and reference")
    parser.add_argument("--model", default="soccer", help="network of the package, or a model file")
    parser.add_argument("--near", type=float, default=8.0, help="distance of interest [m]")
    parser.add_argument("--json", type=Path, help="summary to write")
    options = parser.parse_args()
    detector = Detector.from_file(model_path(options.model))
    counts = score(options.folder / "real", detector, options.near)
    for kind, each in counts.items():
        for what, texts in (("missed", each.missed), ("false", each.false), ("people", each.people)):
            for text in texts:
                print(f"{kind}, {what}: {text}")
    found: dict[str, Any] = {kind: each.summary() for kind, each in counts.items()}
    rows = [[kind, *map(str, each.values())] for kind, each in found.items()]
    print("\n".join(["", *aligned([["real frames", *next(iter(found.values()))], *rows])]))
    found["golden"] = against_golden(options.folder / "reference", detector)
    rows = [[name, *map(str, each.values())] for name, each in found["golden"].items()]
    print("\n".join(["", *aligned([["against golden", "F1", "precision", "recall"], *rows])]))
    if options.json:
        options.json.write_text(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
