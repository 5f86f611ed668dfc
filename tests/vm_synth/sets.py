"""Tiny sets of pictures, written by the renderer's own functions but drawn without a ray tracer."""

import cv2
import numpy as np

from vm_synth.dataset.picture_writer import write_picture
from vm_synth.dataset.plan import Plan
from vm_synth.render.picture import UNLABELED, Render
from vm_synth.scene.camera import CameraRanges
from vm_synth.scene.configuration import CLASSES, GroundRanges, SceneConfiguration, TargetRanges, ThingRanges
from vm_synth.scene.draw_scene import draw_scene
from vm_synth.scene.environment import Environment
from vm_workstation.outlines import sphere_outline

SIZE = (96, 64)

NOTHING = dict.fromkeys(("robots", "clutter", "round_things", "furniture", "people"), (0, 0))

CONFIGURATION = SceneConfiguration(
    camera=CameraRanges(picture_width=SIZE[0], picture_height=SIZE[1], height=(0.3, 0.6)),
    ground=GroundRanges(photographed=0.0),
    ball=TargetRanges(missing=0.2, radius=(0.1, 0.2), distance=(0.1, 1.0)),
    things=ThingRanges(**NOTHING, carrier=0.0),
)


def scene_of(index):
    radiance = np.full((64, 128, 3), 0.5, dtype=np.float32)
    return draw_scene(np.random.default_rng([5, index]), CONFIGURATION, Environment("room", radiance, None))


def picture_of(scene):
    """A gray picture whose ball is its outline filled with white, on a field in the lower half."""
    height, width = SIZE[1], SIZE[0]
    classes = np.full((height, width), CLASSES.index("environment"), dtype=np.uint8)
    classes[height // 2 :] = CLASSES.index("field")
    classes[-4:] = CLASSES.index("line")
    classes[:, 0] = UNLABELED
    coverage = np.zeros((height, width), dtype=np.float32)
    if scene.ball is not None:
        pixels = sphere_outline(scene.lens, scene.orientation, scene.ball.center, scene.ball.radius, scene.size)
        if np.isfinite(pixels).all():
            area = np.zeros((height, width), dtype=np.uint8)
            cv2.fillPoly(area, [np.rint(np.clip(pixels, -999, 999) * 16).astype(np.int32)], 1, shift=4)
            coverage[area > 0] = 1.0
            classes[area > 0] = CLASSES.index("ball")
    radiance = np.full((height, width, 3), 0.05, dtype=np.float32)
    radiance[coverage > 0] = 0.6
    return Render(radiance, classes, coverage)


def write_set(folder, indices, count=None):
    """Write these pictures of a set of `count`, by default as many as these."""
    folder.mkdir(parents=True, exist_ok=True)
    indices = list(indices)
    Plan(5, len(indices) if count is None else count, CONFIGURATION, {"room": "0" * 64}).write(folder)
    for index in indices:
        scene = scene_of(index)
        write_picture(folder, index, "room", scene, picture_of(scene))
    return folder
