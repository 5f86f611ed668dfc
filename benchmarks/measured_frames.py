"""Balls found, missed and false on frames whose balls were measured by hand.

    python -m benchmarks.measured_frames ../shared/real --object-radius 0.11 --sheet real.jpg

With `--json benchmarks/measured_frames.json`, shipped_report.py writes the README's sentence from the result.

A folder holds `images/imageX.jpg` with `images/lensX.yaml`, and `balls.json`: for each frame its ball, or a list of its
balls, with center `cx`, `cy` and radius `r_px` [px], and distance `dist` from the camera [m]. A detection is right if
its center lies on a ball that no detection before it took.
"""

from __future__ import annotations

import argparse
import json
import math
import textwrap
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vm_embedded.arrays import Image
from vm_embedded.borders.opencv_text import draw_text
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.detection import Detection
from vm_embedded.detection.detector import Detector
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_workstation.contact_sheet import write_sheet

RESULTS = Path(__file__).with_name("measured_frames.json")
CELL = 240  # [px]


@dataclass
class Score:
    """Result on some frames: balls found with their relative errors of distance, missed balls, and false ones."""

    frames: int = 0
    found: list[tuple[str, dict[str, float], Detection]] = field(default_factory=list)
    missed: list[tuple[str, dict[str, float]]] = field(default_factory=list)
    false: list[tuple[str, Detection]] = field(default_factory=list)

    def summary(self, near: float) -> dict[str, Any]:
        """Counts of all balls, and of those nearer than `near` [m]."""
        close = sum(ball["dist"] < near for _, ball, _ in self.found)
        close_missed = sum(ball["dist"] < near for _, ball in self.missed)
        errors = [abs(detection.distance / ball["dist"] - 1.0) for _, ball, detection in self.found]
        return {
            "frames": self.frames,
            "near": near,
            "balls": len(self.found) + len(self.missed),
            "found": len(self.found),
            "balls_near": close + close_missed,
            "found_near": close,
            "false": len(self.false),
            "distance_error": round(float(np.median(errors)), 4) if errors else None,
        }


def score(folder: Path, detector: Detector) -> Score:
    """Detect in every frame of a folder and compare with the truth."""
    truth = json.loads((folder / "balls.json").read_text())
    result = Score()
    for path in sorted((folder / "images").glob("image*.jpg")):
        lens = read_lens_file(path.with_name(path.name.replace("image", "lens")).with_suffix(".yaml"))
        assert lens.orientation is not None
        found = detector.detect(read_image(path), lens.orientation, lens.lens)
        result.frames += 1
        balls = truth.get(path.name, [])
        left = [balls] if isinstance(balls, dict) else list(balls)
        for detection in found.objects:
            x, y = detection.center
            hit = next((each for each in left if math.hypot(x - each["cx"], y - each["cy"]) < each["r_px"]), None)
            if hit is None:
                result.false.append((path.name, detection))
            else:
                left.remove(hit)
                result.found.append((path.name, hit, detection))
        result.missed += [(path.name, each) for each in left]
    return result


def sentence(result: dict[str, Any]) -> str:
    """The README's sentence about the frames of ../shared/real, from a summary."""
    false = {0: "no false ball", 1: "one false ball"}.get(result["false"], f"{result['false']} false balls")
    text = (
        f"On {result['frames']} frames of real robots in four halls, `{DEFAULT}` finds {result['found']} of "
        f"{result['balls']} balls, {result['found_near']} of the {result['balls_near']} nearer than "
        f"{result['near']:g} m, and reports {false}."
    )
    return textwrap.fill(text, 120)


def sheet(folder: Path, result: Score) -> Image:
    """Every missed ball, with the truth in magenta, and every false one, in yellow."""
    cells = [
        _cell(
            folder / "images" / name,
            (ball["cx"], ball["cy"]),
            ball["r_px"],
            (255, 0, 255),
            f"missed {ball['dist']:.1f} m",
        )
        for name, ball in result.missed
    ]
    cells += [
        _cell(
            folder / "images" / name,
            each.center,
            each.radius,
            (0, 220, 255),
            f"false {each.confidence:.2f} {each.distance:.1f} m",
        )
        for name, each in result.false
    ]
    if not cells:
        return np.full((CELL, CELL, 3), 255, dtype=np.uint8)
    columns = min(len(cells), 6)
    cells += [np.zeros_like(cells[0])] * (-len(cells) % columns)
    return np.vstack([np.hstack(cells[start : start + columns]) for start in range(0, len(cells), columns)])


def _cell(path: Path, center: Any, radius: float, color: tuple[int, int, int], text: str) -> Image:
    image = read_image(path)
    half = max(6.0 * radius, 30.0)
    scale = CELL / (2.0 * half)
    matrix = np.array([[scale, 0.0, CELL / 2 - scale * center[0]], [0.0, scale, CELL / 2 - scale * center[1]]])
    cell = np.asarray(cv2.warpAffine(image, matrix, (CELL, CELL), flags=cv2.INTER_CUBIC), dtype=np.uint8)
    cv2.circle(cell, (CELL // 2, CELL // 2), round(scale * radius) + 3, color, 1, cv2.LINE_AA)
    for shade, thickness in ((0, 3), (255, 1)):
        for line, at in ((text, 16), (path.stem, CELL - 8)):
            draw_text(cell, line, (5, at), 0.45, (shade,) * 3, thickness)
    return cell


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", type=Path, default=model_path(DEFAULT))
    parser.add_argument("--object-radius", type=float)
    parser.add_argument("--threshold", type=float)
    parser.add_argument("--near", type=float, default=6.0, help="count balls nearer than this separately [m]")
    parser.add_argument("--sheet", type=Path, help="picture of misses and false balls to write")
    parser.add_argument("--json", type=Path, help="summary to write")
    options = parser.parse_args()
    chosen = {"object_radius": options.object_radius, "threshold": options.threshold}
    settings = Settings(**{name: value for name, value in chosen.items() if value is not None})
    result = score(options.folder, Detector.from_file(options.model, settings))
    for name, ball in result.missed:
        print(f"{name}: missed at ({ball['cx']:.0f}, {ball['cy']:.0f}), {ball['dist']:.1f} m")
    for name, each in result.false:
        x, y = each.center
        print(f"{name}: false at ({x:.0f}, {y:.0f}), {each.distance:.1f} m, confidence {each.confidence:.2f}")
    print(json.dumps(result.summary(options.near)))
    if options.json:
        options.json.write_text(json.dumps(result.summary(options.near)) + "\n")
    if options.sheet:
        write_sheet(options.sheet, sheet(options.folder, result))


if __name__ == "__main__":
    main()
