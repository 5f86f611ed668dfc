"""Drawn pictures and a short configuration, for the tests of the close look."""

import json

import cv2
import numpy as np
import pytest

from vm_embedded.geometry.shapes import Sphere
from vm_workstation.outlines import shape_outline

from ..drawn import draw_set
from ..fields import CAMERA, CLASSES, COLORS, LENS, SIZE, picture, write_pictures

TINY = """
[data]
validation = 0.25
[patches]
size = 16
max_proposals = 10
jittered = 2
random = 2
[network]
channels = [4, 6, 8]
hidden = 8
[training]
epochs = 4
rounds = 2
batch = 16
"""
"""A look.toml for which seconds are enough."""


@pytest.fixture(scope="session")
def drawn(tmp_path_factory):
    """Folder of twenty drawn pictures."""
    return draw_set(tmp_path_factory.mktemp("drawn"), 20, seed=3)


GRAYS = {"ball": 200, "goal": 240, "line": 250, "field": 90, "robot": 30, "environment": 140}
"""Of the classes, in the pictures of `field`."""


@pytest.fixture(scope="session")
def field(tmp_path_factory):
    """Folder of eight pictures of the drawn field in grays, with a ball, and with other brightness in each."""
    folder = write_pictures(tmp_path_factory.mktemp("field"), 8)
    for number in range(8):
        random, labels = np.random.default_rng(number), picture().labels.copy()
        center = np.array([*random.uniform((1.4, -0.6), (2.2, 0.1)), 0.1])
        outline = np.rint(shape_outline(LENS, CAMERA, Sphere(0.1), center=center, size=SIZE)).astype(np.int32)
        cv2.fillConvexPoly(labels.view(np.uint8), outline, CLASSES.index("ball"))
        mask, gray = (np.array([each[name] for name in CLASSES], dtype=np.uint8)[labels] for each in (COLORS, GRAYS))
        gray = cv2.convertScaleAbs(gray, alpha=1.0 - 0.05 * number)
        gray = cv2.add(gray, random.integers(0, 12, gray.shape, dtype=np.uint8))
        cv2.imwrite(str(folder / f"image{number}.jpg"), cv2.merge([gray] * 3))
        cv2.imwrite(str(folder / f"mask{number}.png"), mask[..., ::-1])
        scene = folder / f"scene{number}.json"
        ball = {"center": center.tolist(), "radius": 0.1, "visible": 1.0}
        scene.write_text(json.dumps(json.loads(scene.read_text()) | {"ball_radius": 0.1, "ball": ball}))
    return folder


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """A look.toml for which seconds are enough."""
    path = tmp_path_factory.mktemp("configuration") / "look.toml"
    path.write_text(TINY)
    return path
