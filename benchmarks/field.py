"""Accuracy of field features and of points by class, against the limits that a network should keep.

    python -m benchmarks.field TEST --model soccer

TEST is a folder of test sets of vm-synth, such as `make test-data` renders. Writes benchmarks/field.json. False posts,
false robots and wrong lines count at all distances; recalls up to the distance of their limit.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.shipped import SETS, evaluation
from vm_embedded.detection.settings import Settings
from vm_embedded.network.bundled import model_path
from vm_train.data.pictures import find_pictures
from vm_train.evaluation.evaluation import Evaluation
from vm_train.evaluation.summary import field_tables
from vm_train.scores.point_scores import PointScores
from vm_workstation.text_tables import aligned

RESULTS = Path(__file__).parent / "field.json"

RANGES = {"to 10 m": range(20), "below 6 m": range(12), "6 to 10 m": range(12, 20)}
"""Bins of half a meter."""

LARGEST_DROP = 0.08
"""Of the F1 of a class from below 6 m to 6 to 10 m."""

LEAST_F1 = {"field": 0.97, "line": 0.85, "goal": 0.80, "robot": 0.80}
"""Up to 10 m."""


@dataclass(frozen=True)
class Figure:
    """A figure, its limit, and whether it may be at most the limit, rather than at least. None: nothing to measure."""

    name: str
    value: float | None
    limit: float
    at_most: bool = False

    @property
    def is_kept(self) -> bool | None:
        """Whether the limit is kept; None without a value."""
        if self.value is None:
            return None
        return self.value <= self.limit if self.at_most else self.value >= self.limit

    def row(self) -> list[str]:
        """Name, value, limit and verdict as text."""
        value = "-" if self.value is None else f"{self.value:.3f}"
        verdict = {True: "yes", False: "NO", None: "-"}[self.is_kept]
        return [self.name, value, f"{'<=' if self.at_most else '>='} {self.limit:g}", verdict]


def f1_of_points(points: PointScores) -> dict[str, dict[str, float | None]]:
    """F1 of each class at the probability 0.5, in each of RANGES."""
    return {
        name: {where: points.ranking(name, bins).as_dict()["f1"] for where, bins in RANGES.items()}
        for name in points.classes
    }


def figures(f1: dict[str, dict[str, float | None]], features: dict[str, Any]) -> Iterator[Figure]:
    """All figures with a limit. features: the content of FieldScores.as_dict."""
    for name, limit in LEAST_F1.items():
        yield Figure(f"F1 of {name} to 10 m", f1[name]["to 10 m"], limit)
    for name, each in f1.items():
        near, far = each["below 6 m"], each["6 to 10 m"]
        drop = None if near is None or far is None else near - far
        yield Figure(f"F1 of {name}, drop beyond 6 m", drop, LARGEST_DROP, at_most=True)
    for kind, false in (("posts", 0.1), ("robots", 0.15)):
        found = features[kind]
        title = f"{kind} to {found['limit']:g} m within {100.0 * found['tolerance']:g} %"
        yield Figure(title, found["near"]["recall"], 0.85)
        yield Figure(f"false {kind} per picture", found["all"]["false_per_picture"], false, at_most=True)
    lines = features["lines"]
    yield Figure(f"lines to {lines['limit']:g} m", lines["near"]["recall"], 0.85)
    yield Figure("wrong share of lines", lines["all"]["wrong_share"], 0.10, at_most=True)
    yield Figure("border, median error", features["border"]["all"]["error_median"], 0.02, at_most=True)


def report(name: str, result: Evaluation) -> dict[str, Any]:
    """Print the tables of a test set, and return their numbers."""
    if result.features is None:
        raise SystemExit("the network lacks one of the classes goal, line, field and robot")
    f1, features = f1_of_points(result.points), result.features.as_dict()
    print(f"\n{name}: {len(result.poses)} pictures, {len(result.faults)} skipped\n")
    rows = [[each, *("-" if value is None else f"{value:.3f}" for value in f1[each].values())] for each in f1]
    print("\n".join(aligned([["F1 of points", *RANGES], *rows])))
    for title, (heading, body) in field_tables(features).items():
        print("\n".join(["", title, *aligned([heading, *body])]))
    table = [["figure", "value", "limit", "kept"], *(each.row() for each in figures(f1, features))]
    print("\n".join(["", *aligned(table)]), flush=True)
    return {"pictures": len(result.poses), "skipped": len(result.faults), "f1": f1, "features": features}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("test", type=Path, help="folder of test sets, or one set")
    parser.add_argument("--model", default="soccer", help="network of the package, or a model file")
    parser.add_argument("--as-robot", action="store_true", help="run the detector as on a robot")
    parser.add_argument("--count", type=int, default=0, help="use only so many pictures of each set, the last ones")
    parser.add_argument("--workers", type=int, help="processes; default: one for each core")
    parser.add_argument("--json", type=Path, default=RESULTS, help="file to write")
    options = parser.parse_args()
    model, folders = model_path(options.model), [options.test / each for each in SETS]
    if not any(each.is_dir() for each in folders):
        folders = [options.test]
    found = {}
    for each in folders:
        pictures = find_pictures(each)[-options.count :]  # 0: all
        done = evaluation(model, pictures, Settings(), options.workers, options.as_robot)
        found[each.name] = report(each.name, done)
    options.json.write_text(json.dumps({"model": Path(options.model).name, "sets": found}) + "\n")


if __name__ == "__main__":
    main()
