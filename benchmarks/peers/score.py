"""Scores the trained peers and the networks of the package on the same pictures.

    python -m benchmarks.peers.score data/test build/peers
    python -m benchmarks.peers.score data/test build/peers --lens rectilinear

Thresholds and the tolerance of sizes are chosen on the validation pictures of the training, where F1 is best. Writes
benchmarks/peer_scores.json. With --lens, it scores on fields those that learned from one kind of lens only. The paper
compares average precision over distance, too (section "Discussion and Conclusion").
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
from vm_embedded.files import write_file
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.network.bundled import model_path
from vm_embedded.network.model_file import read_model
from vm_train.data.picture_files import PictureFiles
from vm_train.data.pictures import Picture, find_pictures
from vm_train.scores.object_scores import ObjectScores

from ..shipped import CANDIDATES, METERS, RANGES, SETS, classes_of
from .boxes import LENSES, kind_of_lens, read_truths
from .detector import TRAINED, BoxDetector, FrameDetector, located, reported
from .train import ALL_LENSES, folder_of

RESULTS = Path(__file__).parents[1] / "peer_scores.json"
SAME = "ball, same pictures"
"""A network with the recipe of `ball` that learned from the pictures of the peers."""

OURS = ("ball", "soccer", SAME)

FIELD = "field"
ELSEWHERE = tuple(each for each in SETS if each != FIELD)
TOLERANCES = (1.25, 1.5, 2.0, 3.0)
FACTORS = (1.0, 0.5, 0.25)
"""Sizes of the test pictures of 1280 x 1024 px: twice, as large as, and half as large as those of the training."""

BEYOND = {"0.5 to 6 m": RANGES["0.5 to 6 m"], "6 to 10 m": RANGES["6 to 10 m"], "4 to 10 m": range(8, 20), "all": None}
SHARED = (("real", 0.11), ("reference", 0.075))
"""Folders with frames of real cameras, and the radius of their ball [m]."""


@dataclass(frozen=True)
class Choice:
    """What the validation pictures chose for a peer."""

    threshold: float
    tolerance: float
    threshold_with_tolerance: float


def resized(picture: Picture, factor: float) -> tuple[np.ndarray, LensFile]:
    """A picture and its lens in another size."""
    if factor == 1.0:
        return picture.image, picture.lens
    image = cv2.resize(picture.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    size = (picture.image.shape[1], picture.image.shape[0])
    lens = picture.lens.lens.for_image(size).scaled(factor, (image.shape[1], image.shape[0]))
    return np.asarray(image), LensFile(lens, picture.lens.orientation)


class Tally:
    """Scores of a detector on a test set: of all pictures, and by the kind of lens."""

    def __init__(self) -> None:
        self.all = ObjectScores(min_radius=2.0)
        self.by_lens = {kind: ObjectScores(min_radius=2.0) for kind in LENSES}

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
            tally.add(kind_of_lens(files), truths, reported(objects, 0.0, tolerance))
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
        found.add(kind_of_lens(files), truths, large)
    return found


def choose(detector: BoxDetector, pictures: Sequence[PictureFiles]) -> Choice:
    """Threshold and tolerance with the best F1 on validation pictures."""
    tallies = tally_peer(detector, pictures, (None, *TOLERANCES))
    best = {tolerance: _best(tally.all) for tolerance, tally in tallies.items()}
    tolerance = max(TOLERANCES, key=lambda each: best[each][0])
    return Choice(best[None][1], tolerance, best[tolerance][1])


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
    parser.add_argument("--lens", choices=LENSES, default=ALL_LENSES, help="those that learned from this kind only")
    options = parser.parse_args()
    chosen = options.only or names
    trained = folder_of(options.trained, options.lens)
    validation = _validation(trained / "boxes")
    for peer in [each for each in TRAINED if each.name in chosen]:
        detector = BoxDetector(peer, trained / f"{peer.stem}.onnx")
        choice = choose(detector, validation)
        row = peer_on_fields(detector, choice, options.test)
        if options.lens == ALL_LENSES:
            row |= peer_elsewhere(detector, choice, options.test, options.shared)
        _write(title(peer.name, options.lens), row)
    for name in [each for each in (OURS if options.lens == ALL_LENSES else (SAME,)) if each in chosen]:
        file = trained / "ball.onnx" if name == SAME else model_path(name)
        row = ours_on_fields(file, options.test)
        if options.lens == ALL_LENSES:
            row |= ours_elsewhere(file, options.test, options.shared)
        _write(title(name, options.lens), row)


def title(name: str, lens: str) -> str:
    """The name in the results of a detector that learned from a kind of lens."""
    return name if lens == ALL_LENSES else f"{name}, only {lens}"


def peer_on_fields(detector: BoxDetector, choice: Choice, test: Path) -> dict[str, Any]:
    """Figures of a peer on fields, also by the kind of lens and the size of the pictures."""
    fields, tolerances = find_pictures(test / FIELD), (None, choice.tolerance)
    tallies = {factor: tally_peer(detector, fields, tolerances, factor) for factor in FACTORS}
    row = {
        "choice": vars(choice),
        **_on_fields({each: tally[None] for each, tally in tallies.items()}, choice.threshold),
    }
    checked = tallies[1.0][choice.tolerance].all
    return row | {f"{FIELD}, sizes checked": numbers(checked, choice.threshold_with_tolerance)}


def ours_on_fields(file: Path, test: Path) -> dict[str, Any]:
    """The same figures of a network of ours, with its default threshold."""
    fields = find_pictures(test / FIELD)
    tallies = {factor: tally_ours(file, fields, factor, CANDIDATES) for factor in FACTORS}
    return _on_fields(tallies, Settings().min_confidence)


def _on_fields(tallies: dict[float, Tally], threshold: float) -> dict[str, Any]:
    """Figures from a tally for each size of the pictures."""
    whole = tallies[1.0]
    return {
        FIELD: numbers(whole.all, threshold),
        "lenses": {kind: numbers(scores, threshold)["all"] for kind, scores in whole.by_lens.items()},
        "sizes": {f"{factor:g}": numbers(tally.all, threshold)["all"] for factor, tally in tallies.items()},
        "curve": _curve(whole),
    }


def peer_elsewhere(detector: BoxDetector, choice: Choice, test: Path, shared: Path | None) -> dict[str, Any]:
    """Figures of a peer on the other test sets and on frames of real cameras."""
    row: dict[str, Any] = {}
    for name in ELSEWHERE:
        tallies = tally_peer(detector, find_pictures(test / name), (None, choice.tolerance))
        row[name] = numbers(tallies[None].all, choice.threshold)
        row[f"{name}, sizes checked"] = numbers(tallies[choice.tolerance].all, choice.threshold_with_tolerance)
    used = choice.threshold_with_tolerance, choice.tolerance
    return row | {"frames": _frames(shared, lambda radius: FrameDetector(detector, radius, *used))}


def ours_elsewhere(file: Path, test: Path, shared: Path | None) -> dict[str, Any]:
    """The same figures of a network of ours."""
    row: dict[str, Any] = {}
    for name in ELSEWHERE:
        tally = tally_ours(file, find_pictures(test / name), 1.0, CANDIDATES)
        row[name] = numbers(tally.all, Settings().min_confidence)
    return row | {"frames": _frames(shared, lambda radius: Detector.from_file(file, Settings(object_radius=radius)))}


def _curve(tally: Tally) -> list[list[float]]:
    """Recall and precision at the paper's overlap."""
    curve = tally.all.ranking(0.75).precision_recall
    chosen = np.unique(np.linspace(0, len(curve.recall) - 1, 150).astype(int)) if len(curve.recall) else []
    return [[round(float(each[at]), 4) for each in (curve.recall, curve.precision)] for at in chosen]


def _frames(shared: Path | None, detector: Callable[[float], Any]) -> dict[str, Any]:
    """Figures on frames of real cameras. detector: by the radius of the ball [m]."""
    folders = [] if shared is None else SHARED
    return {name: measured_frames.score(shared / name, detector(radius)).summary(6.0) for name, radius in folders}


def _validation(boxes: Path) -> list[PictureFiles]:
    """The validation pictures of a folder of `write_boxes`."""
    links = sorted((boxes / "images" / "validation").iterdir())
    numbers = {each.stem for each in links}
    return [each for each in find_pictures(links[0].resolve().parent) if each.number in numbers]


def _write(name: str, row: dict[str, Any]) -> None:
    """Add a row to the results. It reads them again, because another process may score other detectors."""
    found: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    write_file(RESULTS, json.dumps(found | {name: row}, indent=1) + "\n")
    print(name, json.dumps(row["sizes"]["1"]), flush=True)


if __name__ == "__main__":
    main()
