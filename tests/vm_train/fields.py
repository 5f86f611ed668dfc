"""A painted field with two posts, two robots and a person, for tests of field features. No ray is traced."""

import json
import math
from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from vm_embedded.field.features import Border, CenterCircle, FieldFeatures, Segment, Upright
from vm_embedded.geometry.lens_files import LensFile, format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Rectilinear
from vm_synth.render.ground import paint_ground
from vm_synth.scene.field import FieldRanges, draw_field
from vm_train.data.pictures import Picture

CLASSES = ("ball", "goal", "line", "field", "robot", "environment")
SIZE = (640, 480)
CAMERA = Orientation.from_roll_pitch(0.9, roll=0.04, pitch=math.radians(16.0), yaw=0.3)
LENS = Rectilinear(focal_length=330.0, fov=2.6, center=(4.0, -3.0))
FIELD = replace(
    draw_field(np.random.default_rng(5), FieldRanges()),
    length=9.0,
    width=6.0,
    line_width=0.08,
    border=0.6,
    middle=(2.6, 0.9),
    heading=0.2,
    wear=0.0,
)
STANDING = [
    {"kind": "post", "base": [5.0, 2.0], "width": 0.1, "height": 1.2},
    {"kind": "post", "base": [3.0, 0.2], "width": 0.1, "height": 1.2},
    {"kind": "post", "base": [-3.0, 0.0], "width": 0.1, "height": 1.2},
    {"kind": "robot", "base": [2.5, 1.6], "width": 0.4, "height": 0.6},
    {"kind": "robot", "base": [5.0, 3.2], "width": 0.4, "height": 0.6},
    {"kind": "person", "base": [4.0, 0.9], "width": 0.5, "height": 1.7},
]
"""Behind the camera is the third post. The first robot hides the foot of the second."""


def scene_table():
    """The entries of a scene file about the field."""
    names = ("length", "width", "line_width", "border", "heading")
    return {"field": {name: getattr(FIELD, name) for name in names} | {"middle": FIELD.middle}, "standing": STANDING}


def write_scene(path, table=None):
    path.write_text(json.dumps(scene_table() if table is None else table))
    return path


def pixels_of(points):
    """Pixels (n, 2) of points (n, 3) of the world."""
    rays = (points - (0.0, 0.0, CAMERA.height)) @ CAMERA.rotation
    return LENS.project(rays / np.linalg.norm(rays, axis=1, keepdims=True), SIZE)


@cache
def _painted():
    """Shares (h, w) of each pixel that lines and carpet cover."""
    x, y = np.meshgrid(np.arange(SIZE[0], dtype=float), np.arange(SIZE[1], dtype=float))
    rays = LENS.unproject(np.stack([x.ravel(), y.ravel()], axis=1), SIZE) @ CAMERA.rotation.T
    below = rays[:, 2] < -1e-4
    reach = np.where(below, CAMERA.height / -np.where(below, rays[:, 2], -1.0), np.inf)
    ground = np.where(below[:, None], rays[:, :2] * np.where(below, reach, 0.0)[:, None], np.inf)
    _, lines, carpet = paint_ground(FIELD, ground.reshape(*x.shape, 2), reach.reshape(x.shape), 1.0 / 330.0)
    return lines * carpet, carpet


def picture(lines=True, standing=STANDING):
    """The field as the camera sees it."""
    painted, carpet = _painted()
    labels = np.full(carpet.shape, CLASSES.index("environment"), dtype=np.int8)
    labels[carpet > 0.5] = CLASSES.index("field")
    if lines:
        labels[painted > 0.5] = CLASSES.index("line")
    for each in sorted(standing, key=lambda each: -math.hypot(*each["base"])):
        x, y = each["base"]
        if x < 0.0:
            continue
        across = np.array([-y, x]) / math.hypot(x, y) * each["width"] / 2.0
        corners = [(x + side * across[0], y + side * across[1], up) for side, up in ((1, 0), (-1, 0), (-1, 1), (1, 1))]
        outline = np.rint(pixels_of(np.array(corners) * (1.0, 1.0, each["height"]))).astype(np.int32)
        name = {"post": "goal", "robot": "robot", "person": "environment"}[each["kind"]]
        cv2.fillConvexPoly(labels.view(np.uint8), outline, CLASSES.index(name))
    return Picture(np.zeros((*labels.shape, 3), dtype=np.uint8), labels, LensFile(LENS, CAMERA))


COLORS = {
    "ball": (255, 0, 0),
    "goal": (255, 255, 0),
    "line": (255, 255, 255),
    "field": (0, 255, 0),
    "robot": (0, 0, 255),
    "environment": (0, 0, 0),
}


def write_pictures(folder, count):
    """The same picture several times, with all its files."""
    labels = picture().labels
    mask = np.array([COLORS[name][::-1] for name in CLASSES], dtype=np.uint8)[labels]
    for number in range(count):
        cv2.imwrite(str(folder / f"image{number}.jpg"), np.zeros_like(mask))
        cv2.imwrite(str(folder / f"mask{number}.png"), mask)
        (folder / f"lens{number}.yaml").write_text(format_lens_file(LENS, CAMERA))
        write_scene(folder / f"scene{number}.json", {"ball_radius": 0.07, "ball": None} | scene_table())
    return folder


def upright(position, name="goal"):
    """A reported upright at a place (2,) [m]; only its place counts."""
    return Upright(name, 0.9, np.array(position, dtype=float), 0.0, np.zeros(3), np.zeros(2), 0.1)


def features(posts=(), robots=(), lines=(), circle=None, border=None):
    """Reported features: places of posts and robots, ends of lines, center and radius of the circle, border (m, 2)."""
    return FieldFeatures(
        posts=tuple(map(upright, posts)),
        goals=(),
        robots=tuple(upright(each, "robot") for each in robots),
        lines=tuple(Segment(np.array(each, dtype=float), np.zeros((2, 2)), 0.9) for each in lines),
        circle=None if circle is None else CenterCircle(np.array(circle[0], dtype=float), circle[1], 3.0, 0.9),
        crossings=(),
        line_points=np.zeros((0, 2)),
        line_confidences=np.zeros(0, dtype=np.float32),
        border=None if border is None else Border(np.array(border, dtype=float), np.zeros((len(border), 2))),
    )
