"""Scores the trained peers and the networks of the package on the same pictures.

    python -m benchmarks.peers.score data/test build/peers

Thresholds and the tolerance of sizes are chosen on the validation pictures of the training, where F1 is best. Writes
benchmarks/peer_scores.json. The paper compares average precision over distance, too (section "Discussion and
Conclusion").
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks import measured_frames
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError
from vm_embedded.files import atomic_write
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_train.data.picture_files import PictureFiles
from vm_train.data.pictures import Picture, find_pictures
from vm_train.scores.object_scores import ObjectScores

from ..shipped import CANDIDATES, METERS, RANGES, SETS, classes_of
from .boxes import read_truths
from .detector import TRAINED, BoxDetector, FrameDetector, located, reported

RESULTS = Path(__file__).parents[1] / "peer_scores.json"
SAME = "ball, same pictures"
"""A network with the recipe of `ball` that learned from the pictures of the peers."""

OURS = ("ball", "ball-small", SAME)

FIELD = "field"
TOLERANCES = (1.25, 1.5, 2.0, 3.0)
FACTORS = (1.0, 0.5, 0.25)
"""Sizes of the test pictures of 1280 x 1024 px: twice, as large as, and half as large as those of the training."""

BEYOND = {"0.5 to 6 m": RANGES["0.5 to 6 m"], "6 to 10 m": RANGES["6 to 10 m"], "4 to 10 m": range(8, 20), "all": None}
SHARED = (("real", 0.11), ("reference", 0.075))
"""Folders with frames of real cameras, and the radius of their ball [m]."""


@dataclass(frozen=True)
class Choice:
    """What the validation pictures chose for a peer: score and tolerance, each with the F1 that they give."""

    threshold: float
    tolerance: float
    threshold_with_tolerance: float
    f1: float
    f1_with_tolerance: float


def resized(picture: Picture, factor: float) -> tuple[np.ndarray, LensFile]:
    """A picture and its lens in another size."""
    if factor == 1.0:
        return picture.image, picture.lens
    image = cv2.resize(picture.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    size = (picture.image.shape[1], picture.image.shape[0])
    lens = picture.lens.lens.for_image(size).scaled(factor, (image.shape[1], image.shape[0]))
    return np.asarray(image), LensFile(lens, picture.lens.orientation)


def projection(files: PictureFiles) -> str:
    """`rectilinear` or `fisheye`."""
    return "rectilinear" if "RECTILINEAR" in files.lens.read_text() else "fisheye"


class Tally:
    """Scores of a detector on a test set: of all pictures, and by the kind of lens."""

    def __init__(self) -> None:
        self.all = ObjectScores(min_radius=2.0)
        self.by_lens = {kind: ObjectScores(min_radius=2.0) for kind in ("rectilinear", "fisheye")}

    def add(self, lens: str, truths: Sequence[Any], found: Sequence[Any]) -> None:
        self.all.add(truths, found)
        self.by_lens[lens].add(truths, found)


def tally_peer(
    detector: BoxDetector, pictures: Iterable[PictureFiles], tolerances: Sequence[float | None], factor: float = 1.0
) -> dict[float | None, Tally]:
    """Scores of a peer for each tolerance. Boxes of a smaller picture count in the pixels of the whole picture."""
    classes = classes_of(model_path("ball"))
    found = {each: Tally() for each in tolerances}
    for files in pictures:
        picture, radius, truths = read_truths(files, classes)
        image, _ = resized(picture, factor)
        boxes, scores = detector.detect(image)
        size = (picture.image.shape[1], picture.image.shape[0])
        orientation = picture.lens.orientation
        assert orientation is not None
        objects = located(boxes / factor, scores, size, picture.lens.lens, orientation, radius)
        for tolerance, tally in found.items():
            tally.add(projection(files), truths, reported(objects, 0.0, tolerance))
    return found


@dataclass(frozen=True, eq=False)
class _Enlarged:
    """A detection of a smaller picture in the pixels of the whole picture."""

    confidence: float
    outline: np.ndarray
    position: np.ndarray
    bearing: np.ndarray


def enlarged(pixels: np.ndarray, factor: float) -> np.ndarray:
    """Pixels (n, 2) of a smaller picture in the whole picture; they count from the center of the first pixel."""
    return np.asarray((pixels + 0.5) / factor - 0.5)


def tally_ours(file: Path, pictures: Iterable[PictureFiles], factor: float, settings: Settings) -> Tally:
    """Scores of a network of ours, whose mesh has the radius of each picture's ball."""
    classes, model, found = classes_of(file), read_model(file), Tally()
    for files in pictures:
        picture, radius, truths = read_truths(files, classes)
        image, lens = resized(picture, factor)
        assert lens.orientation is not None
        detector = Detector(model, replace(settings, object_radius=radius))
        try:
            objects = detector.detect(image, lens.orientation, lens.lens).objects
        except GeometryError:  # the camera is too low for this ball
            objects = ()
        large = [
            _Enlarged(each.confidence, enlarged(each.outline, factor), each.position, each.bearing) for each in objects
        ]
        found.add(projection(files), truths, large)
    return found


def choose(detector: BoxDetector, pictures: Sequence[PictureFiles]) -> Choice:
    """Threshold and tolerance with the best F1 on validation pictures."""
    tallies = tally_peer(detector, pictures, (None, *TOLERANCES))
    best = {tolerance: _best(tally.all) for tolerance, tally in tallies.items()}
    tolerance = max(TOLERANCES, key=lambda each: best[each][0])
    return Choice(best[None][1], tolerance, best[tolerance][1], best[None][0], best[tolerance][0])


def _best(scores: ObjectScores) -> tuple[float, float]:
    """The best F1 and its threshold."""
    curve = scores.ranking(0.5).precision_recall
    if not len(curve.thresholds):
        return 0.0, 1.0
    f1 = 2.0 * curve.precision * curve.recall / np.maximum(curve.precision + curve.recall, 1e-9)
    return float(f1.max()), float(curve.thresholds[f1.argmax()])


def numbers(scores: ObjectScores, threshold: float) -> dict[str, Any]:
    """Average precisions by distance, and balls found and false from a threshold on."""
    found: dict[str, Any] = {"pictures": scores.pictures, "balls": scores.ranking(0.5).truths}
    for name, bins in (BEYOND | METERS).items():
        rankings = {overlap: scores.ranking(overlap, bins) for overlap in (0.5, 0.75)}
        found[name] = {f"ap{100 * overlap:.0f}": _ap(each) for overlap, each in rankings.items()}
        outcome = rankings[0.5].at(threshold)
        found[name] |= {"found": _rounded(outcome.recall), "false": _rounded(outcome.false_per_picture)}
    return found


def _ap(ranking: Any) -> float | None:
    return _rounded(ranking.precision_recall.average_precision)


def _rounded(value: float) -> float | None:
    return None if np.isnan(value) else round(float(value), 4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("test", type=Path, help="folder of make test-data")
    parser.add_argument("trained", type=Path, help="folder of benchmarks.peers.train")
    parser.add_argument("--shared", type=Path, help="folder with the real and reference frames")
    names = [*(each.name for each in TRAINED), *OURS]
    parser.add_argument("--only", choices=names, action="append", help="score only this detector; repeatable")
    options = parser.parse_args()
    chosen = options.only or names
    found: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    validation = _validation(options.trained / "boxes")
    for peer in [each for each in TRAINED if each.name in chosen]:
        detector = BoxDetector(peer, options.trained / f"{peer.stem}.onnx")
        found[peer.name] = peer_row(detector, choose(detector, validation), options.test, options.shared)
        _write(found, peer.name)
    for name in [each for each in OURS if each in chosen]:
        file = options.trained / "ball.onnx" if name == SAME else model_path(name)
        found[name] = our_row(file, options.test, options.shared)
        _write(found, name)


def peer_row(detector: BoxDetector, choice: Choice, test: Path, shared: Path | None) -> dict[str, Any]:
    """All figures of a peer."""
    row: dict[str, Any] = {"choice": vars(choice)}
    for name in SETS:
        tallies = tally_peer(detector, find_pictures(test / name), (None, choice.tolerance))
        row[name] = numbers(tallies[None].all, choice.threshold)
        row[f"{name}, sizes checked"] = numbers(tallies[choice.tolerance].all, choice.threshold_with_tolerance)
        if name == FIELD:
            row |= _details(tallies[None], choice.threshold)
    row["sizes"] = {"1": row[FIELD]["all"]}
    for factor in FACTORS[1:]:
        tally = tally_peer(detector, find_pictures(test / FIELD), (None,), factor)[None]
        row["sizes"][f"{factor:g}"] = numbers(tally.all, choice.threshold)["all"]
    used = choice.threshold_with_tolerance, choice.tolerance
    row["frames"] = _frames(shared, lambda radius: FrameDetector(detector, radius, *used))
    return row


def our_row(file: Path, test: Path, shared: Path | None) -> dict[str, Any]:
    """The same figures of a network of ours, with its default threshold."""
    row: dict[str, Any] = {}
    threshold = Settings().min_confidence
    for each in SETS:
        tally = tally_ours(file, find_pictures(test / each), 1.0, CANDIDATES)
        row[each] = numbers(tally.all, threshold)
        if each == FIELD:
            row |= _details(tally, threshold)
    row["sizes"] = {"1": row[FIELD]["all"]}
    for factor in FACTORS[1:]:
        tally = tally_ours(file, find_pictures(test / FIELD), factor, CANDIDATES)
        row["sizes"][f"{factor:g}"] = numbers(tally.all, threshold)["all"]
    row["frames"] = _frames(shared, lambda radius: Detector.from_file(file, Settings(object_radius=radius)))
    return row


def _details(tally: Tally, threshold: float) -> dict[str, Any]:
    """Figures by the kind of lens, and precision over recall at the paper's overlap."""
    lenses = {kind: numbers(scores, threshold)["all"] for kind, scores in tally.by_lens.items()}
    curve = tally.all.ranking(0.75).precision_recall
    chosen = np.unique(np.linspace(0, len(curve.recall) - 1, 150).astype(int)) if len(curve.recall) else []
    return {
        "lenses": lenses,
        "curve": [[round(float(each[at]), 4) for each in (curve.recall, curve.precision)] for at in chosen],
    }


def _frames(shared: Path | None, detector: Callable[[float], Any]) -> dict[str, Any]:
    """Figures on frames of real cameras. detector: by the radius of the ball [m]."""
    folders = [] if shared is None else SHARED
    return {name: measured_frames.score(shared / name, detector(radius)).summary(6.0) for name, radius in folders}


def _validation(boxes: Path) -> list[PictureFiles]:
    """The validation pictures of a folder of `write_boxes`."""
    links = sorted((boxes / "images" / "validation").iterdir())
    numbers = {each.stem for each in links}
    return [each for each in find_pictures(links[0].resolve().parent) if each.number in numbers]


def _write(found: dict[str, Any], name: str) -> None:
    with atomic_write(RESULTS) as path:
        path.write_text(json.dumps(found, indent=1) + "\n")
    print(name, json.dumps(found[name].get("field", {}).get("all")), flush=True)


if __name__ == "__main__":
    main()
