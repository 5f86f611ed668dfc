"""Send the poses of a robot's camera to vm-detect, over UDP, a hundred times per second.

vm-detect --camera synthetic --pose-source udp:127.0.0.1:5601 &
python docs/examples/poses_udp.py 127.0.0.1:5601

It needs only the standard library. Replace `camera_pose` by the kinematics of your robot.
"""

import json
import math
import socket
import sys
import time

PERIOD = 0.01
"""Time between two poses [s]."""


def camera_pose(now: float) -> tuple[float, float, float]:
    """Height above the ground [m], pitch below the horizon and yaw to the left [rad] at a time [s].

    Give the yaw relative to the ground or to the robot's feet, not to the camera: it turns the frame of all positions.
    """
    return 0.8 + 0.02 * math.sin(9.0 * now), 0.4 + 0.03 * math.cos(9.0 * now), math.remainder(0.2 * now, math.tau)


def to_quaternion(pitch: float, yaw: float) -> list[float]:
    """The rotation (w, x, y, z) from the camera's frame (x forward, y left, z up) to the plane's."""
    cp, sp, cy, sy = math.cos(pitch / 2), math.sin(pitch / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return [cy * cp, -sy * sp, cy * sp, sy * cp]


def main(address: str) -> None:
    """Send poses until the program is stopped. address: HOST:PORT of vm-detect's --pose-source."""
    host, port = address.rsplit(":", 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending:
        while True:
            now = time.monotonic()
            height, pitch, yaw = camera_pose(now)
            pose = {"t": now, "height": height, "quaternion": to_quaternion(pitch, yaw)}
            sending.sendto(json.dumps(pose).encode(), (host, int(port)))
            time.sleep(PERIOD)


if __name__ == "__main__":
    main(*sys.argv[1:])
