"""Drawn frames with YOLO boxes of two recordings, and a short configuration."""

import cv2
import numpy as np
import pytest

from ..drawn import draw_set

TINY = """
[data]
validation = 0.3
test = 0.3
[patches]
jittered = 2
random = 3
candidates = 4
[training]
epochs = 2
steps = 4
batch = 16
"""
"""A tune.toml for which seconds are enough."""


@pytest.fixture(scope="session")
def frames(tmp_path_factory):
    """Folder of twelve drawn frames of three recordings, with YOLO boxes of class 0."""
    drawn, made = tmp_path_factory.mktemp("drawn"), tmp_path_factory.mktemp("frames")
    draw_set(drawn, 12, seed=5)
    for number in range(12):
        name = f"{'abc'[number // 4]}_{number:04d}"
        (made / f"{name}.jpg").write_bytes((drawn / f"image{number:04d}.jpg").read_bytes())
        mask = cv2.imread(str(drawn / f"mask{number:04d}.png"))
        rows, columns = np.nonzero((mask == (0, 0, 255)).all(axis=2))
        line = ""
        if len(rows):
            height, width = mask.shape[:2]
            left, right, top, bottom = columns.min(), columns.max() + 1, rows.min(), rows.max() + 1
            values = (left + right) / 2 / width, (top + bottom) / 2 / height, (right - left) / width
            line = "0 " + " ".join(f"{each:.8f}" for each in (*values, (bottom - top) / height)) + "\n"
        (made / f"{name}.txt").write_text(line)
    return made


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """A tune.toml for which seconds are enough."""
    path = tmp_path_factory.mktemp("configuration") / "tune.toml"
    path.write_text(TINY)
    return path
