"""Drawn frames with boxes from their truth, and with lens and pose, as a user has them."""

import json
import shutil

import numpy as np

from tests.vm_train.drawn import RADIUS, SIZE, draw_set
from vm_embedded.geometry.lens_files import read_lens_file
from vm_workstation.outlines import sphere_outline


def true_box(folder, number):
    """Edges of the ball [px] from 0 to width and height, or None: left, top, right, bottom, clipped to the picture."""
    ball = json.loads((folder / f"scene{number}.json").read_text())["ball"]
    if ball is None:
        return None
    file = read_lens_file(folder / f"lens{number}.yaml")
    outline = sphere_outline(file.lens, file.orientation, np.array(ball["center"]), RADIUS, SIZE) + 0.5
    low, high = np.maximum(outline.min(axis=0), 0.0), np.minimum(outline.max(axis=0), SIZE)
    return None if (high - low < 2.0).any() else (*low.tolist(), *high.tolist())


def yolo_line(box):
    left, top, right, bottom = box
    width, height = SIZE
    middle = (left + right) / 2 / width, (top + bottom) / 2 / height
    return f"0 {middle[0]:.6f} {middle[1]:.6f} {(right - left) / width:.6f} {(bottom - top) / height:.6f}\n"


def draw_frames(folder, count, seed=0):
    """Frames as image0000.jpg, lens0000.yaml and image0000.txt, in `folder`; the set with masks in `folder`-drawn."""
    drawn = draw_set(folder.with_name(f"{folder.name}-drawn"), count, seed)
    folder.mkdir()
    for image in sorted(drawn.glob("image*.jpg")):
        number = image.stem.removeprefix("image")
        box = true_box(drawn, number)
        shutil.copy(image, folder)
        shutil.copy(drawn / f"lens{number}.yaml", folder)
        (folder / f"image{number}.txt").write_text("" if box is None else yolo_line(box))
    return folder, drawn
