"""A painted field with two posts, two robots and a person, for tests of field features. No ray is traced."""

import json
import math
from dataclasses import replace

import cv2
import numpy as np

from vm_embedded.field.features import Border, CenterCircle, FieldFeatures, Segment, Upright
from vm_embedded.geometry.lens_files import LensFile
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
    **{
        "length": 9.0,
        "width": 6.0,
        "line_width": 0.08,
        "border": 0.6,
        "middle": (2.6, 0.9),
        "heading": 0.2,
        "wear": 0.0,
    },
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


def picture(lines=True):
    """The field as the camera sees it."""
    x, y = np.meshgrid(np.arange(SIZE[0], dtype=float), np.arange(SIZE[1], dtype=float))
    rays = LENS.unproject(np.stack([x.ravel(), y.ravel()], axis=1), SIZE) @ CAMERA.rotation.T
    reach = np.where(rays[:, 2] < -1e-4, CAMERA.height / -rays[:, 2], np.inf)
    ground = np.where(
        np.isfinite(reach)[:, None], rays[:, :2] * np.where(np.isfinite(reach), reach, 0.0)[:, None], np.inf
    )
    shape = x.shape
    _, painted, carpet = paint_ground(FIELD, ground.reshape(*shape, 2), reach.reshape(shape), 1.0 / 330.0)
    labels = np.full(shape, CLASSES.index("environment"), dtype=np.int8)
    labels[carpet > 0.5] = CLASSES.index("field")
    if lines:
        labels[painted * carpet > 0.5] = CLASSES.index("line")
    for each in sorted(STANDING, key=lambda each: -math.hypot(*each["base"])):
        x, y = each["base"]
        if x < 0.0:
            continue
        across = np.array([-y, x]) / math.hypot(x, y) * each["width"] / 2.0
        corners = [(x + side * across[0], y + side * across[1], up) for side, up in ((1, 0), (-1, 0), (-1, 1), (1, 1))]
        corners = np.array(corners) * (1.0, 1.0, each["height"])
        name = {"post": "goal", "robot": "robot", "person": "environment"}[each["kind"]]
        cv2.fillConvexPoly(labels.view(np.uint8), np.rint(pixels_of(corners)).astype(np.int32), CLASSES.index(name))
    return Picture(np.zeros((*shape, 3), dtype=np.uint8), labels, LensFile(LENS, CAMERA))


def upright(position, name="goal"):
    """A reported upright at a place (2,) [m]; only its place counts."""
    return Upright(name, np.array(position, dtype=float), 0.0, np.zeros(3), np.zeros(2), 0.1, 0.9)


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
