"""Find the balls in a picture, print them, and draw them into a copy of it.

python docs/examples/picture.py PICTURE LENS COPY
"""

import sys

import cv2

from vm_embedded import Detector, read_lens_file


def main(picture: str, lens_file: str, copy: str) -> None:
    """Detect in one picture. The lens file must hold the camera's pose, too: Hoc."""
    image, camera = cv2.imread(picture), read_lens_file(lens_file)
    if image is None or camera.orientation is None:
        raise SystemExit(f"{picture} is no picture, or {lens_file} has no Hoc")
    detections = Detector.from_file("ball").detect(image, camera.orientation, camera.lens)
    for ball in detections:
        x, y, _ = ball.position
        print(f"{ball.class_name} {ball.confidence:.2f}: {x:.2f} m ahead, {y:.2f} m to the left")
    detections.save(copy)


if __name__ == "__main__":
    main(*sys.argv[1:])
