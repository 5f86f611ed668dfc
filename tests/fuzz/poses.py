"""Pose lines: parsed, and taken by a stream of each clock and frame."""

from vm_embedded.errors import InputError
from vm_embedded.poses.settings import CLOCKS, FRAMES, PoseSettings
from vm_embedded.poses.stream import PoseStream


def run(data: bytes) -> None:
    reasons: list[str] = []
    for clock in CLOCKS:
        for frame in FRAMES:
            stream = PoseStream(PoseSettings(source="stdin", clock=clock, frame=frame), reasons.append)
            for line in data.split(b"\n")[:8]:
                stream.take(line)
    if reasons:
        raise InputError(max(reasons, key=lambda reason: not reason.isprintable()))
