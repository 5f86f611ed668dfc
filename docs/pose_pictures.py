"""Draws docs/poses.jpg: the mesh on one picture with the right pose, pitched too low, and too high."""

import math
from pathlib import Path

import cv2
import numpy as np

from vm_embedded import Detector, Orientation, read_lens_file
from vm_embedded.detection.overlay import draw_horizon

DOCS = Path(__file__).parent
NUMBER = "0000002"
ERRORS = ((0.0, 1.0), (6.0, 1.0), (0.0, 1.6))
"""Error of the pitch [deg] and factor of the height, for each picture."""


def main() -> None:
    demo = DOCS.parent / "tests" / "fixtures" / "demo"
    file, image = read_lens_file(demo / f"lens{NUMBER}.yaml"), cv2.imread(str(demo / f"image{NUMBER}.jpg"))
    detector, pose = Detector.from_file("soccer"), file.orientation
    pictures = []
    for pitch, height in ERRORS:
        wrong = Orientation.from_roll_pitch(pose.height * height, pose.roll, pose.pitch + math.radians(pitch))
        found = detector.detect(image, wrong, file.lens)
        picture = found.draw()
        draw_horizon(picture, found.observation.view)
        pictures.append(picture)
    sheet = cv2.resize(np.hstack(pictures), None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(DOCS / "poses.jpg"), sheet, [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main()
