"""Follow balls with a camera that stands still, and print where they are and how fast they roll.

python docs/examples/camera.py CAMERA LENS HEIGHT PITCH     (camera number or video; lens file; meters; degrees)

On a robot, use the daemon vm-detect instead: it also handles cameras that fail, and poses that change.
"""

import math
import sys
import time

import cv2

from vm_embedded import Detector, Orientation, Tracker, read_lens_file


def main(source: str, lens_file: str, height: float, pitch: float) -> None:
    """Detect in each frame until the video ends. pitch: below the horizon [degrees]."""
    live = source.isdigit()
    capture = cv2.VideoCapture(int(source) if live else source)
    lens = read_lens_file(lens_file).lens
    orientation = Orientation.from_roll_pitch(height, pitch=math.radians(pitch))
    detector, tracker = Detector.from_file("ball"), Tracker()
    cv2.setNumThreads(1)  # more threads are slower here
    good, image = capture.read()
    while good:
        captured = time.monotonic() if live else 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
        for ball in tracker.update(detector.detect(image, orientation, lens), captured):
            (x, y, _), speed = ball.track.position, math.hypot(*ball.track.velocity)
            print(f"{captured:.2f} s: ball {ball.track.id} at ({x:.2f}, {y:.2f}) m, {speed:.2f} m/s", flush=True)
        good, image = capture.read()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4]))
