"""Field features and frames with them, made by hand."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from vm_embedded import Detector, read_lens_file
from vm_embedded.cameras.image_files import open_source
from vm_embedded.field.features import Border, CenterCircle, Crossing, FieldFeatures, Segment, Upright

DEMO = Path(__file__).parents[2] / "fixtures" / "demo"

NOTHING = FieldFeatures((), (), (), (), None, (), np.empty((0, 2)), np.empty(0, np.float32), None)


def demo_frame(number=0):
    """A picture of the demo and its detections, without features of the field."""
    file = read_lens_file(DEMO / f"lens{number:07d}.yaml")
    (frame,) = open_source(str(DEMO / f"image{number:07d}.jpg")).frames
    image = frame.read()
    return image, Detector.from_file("ball").detect(image, file.orientation, file.lens)


def ahead(view, *places):
    """Places (n, 2) [m], x ahead of the camera and y left, in the plane's frame."""
    return np.array(places) @ view.heading[:2, :2].T


def upright(view, name, x, y, width):
    """Something that stands at a place [m], x ahead of the camera and y left."""
    position = ahead(view, (x, y))
    toward = np.array([*position[0], -view.height])
    distance = float(np.linalg.norm(toward))
    pixel = view.plane_pixels(position)[0]
    return Upright(name, 0.91, position[0], distance, toward / distance, pixel, width)


def segment(view, *ends):
    """The middle line between two places [m], x ahead of the camera and y left."""
    places = ahead(view, *ends)
    return Segment(places, view.plane_pixels(places), 0.88)


def scene(view):
    """Two goal posts, two robots, a penalty area, a center circle, crossings and a border, ahead of the camera."""
    posts = (upright(view, "post", 5.0, 1.3, 0.1), upright(view, "post", 5.0, -1.3, 0.12))
    robots = (upright(view, "robot", 2.2, -0.9, 0.35), upright(view, "robot", 3.6, 1.9, 0.4))
    corners = (5.0, 2.2), (3.2, 2.2), (3.2, -2.2), (5.0, -2.2)
    lines = tuple(segment(view, *pair) for pair in pairwise(corners))
    center, *places = ahead(view, (1.9, 0.0), (3.2, 2.2), (5.0, -2.2), (1.9, 0.75))
    yaw = math.atan2(view.heading[1, 0], view.heading[0, 0])
    kinds = ("L", "T", "X"), (-math.pi / 4, math.pi, 0.0)
    crossings = tuple(
        Crossing(kind, place, math.remainder(heading + yaw, 2.0 * math.pi), 0.77)
        for kind, heading, place in zip(*kinds, places, strict=True)
    )
    outer = ahead(view, (2.0, -3.4), (6.0, -3.2), (6.4, 3.2), (3.0, 3.6))
    return FieldFeatures(
        *(posts, ((0, 1),), robots, lines, CenterCircle(center, 0.75, 4.1, 0.8), crossings),
        *(ahead(view, (3.2, 0.0)), np.array([0.9], np.float32), Border(outer, view.plane_pixels(outer))),
    )


def full(view):
    """As much as a frame can hold: 60 segments, 40 crossings, 12 robots."""
    made = scene(view)
    random = np.random.default_rng(3)
    ends = random.uniform((-9.0, -9.0), (9.0, 9.0), (60, 2, 2))
    lines = tuple(Segment(each, random.uniform(100.0, 1900.0, (2, 2)), 0.8765) for each in ends)
    crossings = tuple(Crossing("LTX"[i % 3], ends[i, 0], -2.3456, 0.7654) for i in range(40))
    places = random.uniform((-9.99, -9.99), (-1.0, -1.0), (12, 2))
    robots = tuple(replace(made.robots[0], position=each, distance=float(np.hypot(*each))) for each in places)
    outer = random.uniform(-9.99, -1.0, (16, 2))
    return replace(made, lines=lines, crossings=crossings, robots=robots, border=Border(outer, 100.0 * abs(outer)))
