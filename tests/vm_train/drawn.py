"""Small drawn sets for tests: a colored ball on a green plane with white lines, below a gray hall. No ray is traced."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import cv2
import numpy as np

from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear

SIZE = (160, 128)
RADIUS = 0.07
CLASSES = """
[classes]
ball = { kind = "object", colors = [[255, 0, 0]] }
line = { kind = "area", colors = [[255, 255, 255]] }
field = { kind = "area", colors = [[0, 255, 0]] }
environment = { kind = "background", colors = [[0, 0, 0]] }
"""
"""For train.toml."""

_COLORS = {"ball": (255, 0, 0), "line": (255, 255, 255), "field": (0, 255, 0), "environment": (0, 0, 0)}


def draw_set(folder: Path, count: int, seed: int = 0, size: tuple[int, int] = SIZE) -> Path:
    """Draw pictures 0000 to count - 1 with masks, lenses and truth. One in ten has no ball."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        random = np.random.default_rng([seed, index])
        image, mask, lens, orientation, ball = _scene(random, size)
        number = f"{index:04d}"
        cv2.imwrite(str(folder / f"image{number}.jpg"), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])
        cv2.imwrite(str(folder / f"mask{number}.png"), mask[..., [2, 1, 0, 3]])
        (folder / f"lens{number}.yaml").write_text(format_lens_file(lens, orientation))
        truth = None
        if ball is not None:
            truth = {
                "center": ball.tolist(),
                "radius": RADIUS,
                "distance": math.hypot(*ball[:2]),
                "visible": 1.0,
            }
        (folder / f"scene{number}.json").write_text(json.dumps({"ball_radius": RADIUS, "ball": truth}))
    return folder


def _scene(random, size):
    width, height = size
    lens = Rectilinear(focal_length=0.6 * width, fov=2.6, center=(0.0, 0.0))
    orientation = Orientation.from_roll_pitch(
        random.uniform(0.45, 0.6), random.uniform(-0.05, 0.05), math.radians(random.uniform(15.0, 35.0))
    )
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    rays = lens.unproject(np.stack([x.ravel(), y.ravel()], axis=1), size) @ orientation.rotation.T
    camera = np.array([0.0, 0.0, orientation.height])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[:, 2] < 0, -camera[2] / rays[:, 2], np.inf)
        ground = camera[:2] + reach[:, None] * rays[:, :2]
    on_field = np.isfinite(reach) & (np.abs(ground) < 4.0).all(axis=1)
    spacing, offset = random.uniform(0.8, 1.5), random.uniform(0.0, 1.0, 2)
    with np.errstate(invalid="ignore"):
        line = on_field & (np.abs((ground / spacing + offset) % 1.0) < 0.05 / spacing).any(axis=1)
    colors = np.empty((len(rays), 3))
    colors[:] = random.uniform(70, 150, 3) * 0.3 + 80.0
    colors[on_field] = np.array([30.0, 120.0, 50.0]) * random.uniform(0.7, 1.2)
    colors[line] = random.uniform(190, 230)
    names = np.where(line, "line", np.where(on_field, "field", "environment"))

    ball = None
    if random.random() < 0.9:
        distance, bearing = random.uniform(0.5, 2.5), random.uniform(-0.45, 0.45)
        ball = np.array([distance * math.cos(bearing), distance * math.sin(bearing), RADIUS])
        toward = ball - camera
        along = rays @ toward
        inside = along**2 - (toward @ toward - RADIUS**2)
        hit = (inside > 0) & (along > 0)
        normal = (camera + (along - np.sqrt(np.maximum(inside, 0)))[:, None] * rays - ball) / RADIUS
        shade = 0.55 + 0.45 * np.clip(normal @ np.array([0.3, 0.2, 0.93]), 0.0, 1.0)
        colors[hit] = (np.array([230.0, 120.0, 30.0]) * shade[:, None])[hit]
        names = np.where(hit, "ball", names)
    image = np.clip(colors * random.uniform(0.8, 1.1) + random.normal(0.0, 6.0, colors.shape), 0, 255)
    mask = np.array([(*_COLORS[name], 255) for name in names.tolist()], dtype=np.uint8)
    return (
        image.reshape(height, width, 3).astype(np.uint8),
        mask.reshape(height, width, 4),
        lens,
        orientation,
        ball,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    draw_set(options.out, options.count, options.seed, (320, 256))
    (options.out / "train.toml").write_text(CLASSES)
