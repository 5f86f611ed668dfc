"""Does the pose check tell right poses from wrong ones? `python -m benchmarks.pose_check HDRI OUT`.

Renders recordings of cameras that walk over fields, turn and sway, then detects with soccer as on a robot, with the
right poses and with a constant error of each kind. A recording has 33 pictures: the daemon looks at every third frame,
so these are 100 frames. Some recordings show an empty carpet without lines, some people beside it. Poses have an error
of 0.3 degrees in each picture, as those of joints do. Writes benchmarks/pose_check.json. Recordings that are there
already are not rendered again.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded import Detector
from vm_embedded.cameras.image_files import read_image
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.detection.pose_check import PoseCheck
from vm_embedded.detection.settings import Settings
from vm_embedded.geometry.lens_files import read_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_synth.bodies.solids import JoinedBodies
from vm_synth.dataset.picture_writer import write_picture
from vm_synth.dataset.workers import Job, scene_of
from vm_synth.render.picture import render
from vm_synth.render.tracer import Tracer
from vm_synth.scene.configuration import SceneConfiguration
from vm_synth.scene.maps import find_maps
from vm_synth.scene.scene import Scene

RESULTS = Path(__file__).with_name("pose_check.json")
SCENES = Path(__file__).parents[1] / "export" / "vm_synth" / "soccer.toml"

RECORDINGS, PICTURES, SEED = 40, 33, 53
EMPTY, CROWDED = 6, 6
"""Recordings more that show an empty carpet, and people beside the field."""

NOISE = math.radians(0.3)
"""Standard deviation of roll and pitch of each picture."""

ERRORS = {
    "none": (0.0, 0.0, 1.0),
    "pitch +3": (3.0, 0.0, 1.0),
    "pitch -3": (-3.0, 0.0, 1.0),
    "roll +3": (0.0, 3.0, 1.0),
    "roll -3": (0.0, -3.0, 1.0),
    "height +10 %": (0.0, 0.0, 1.1),
    "height -10 %": (0.0, 0.0, 0.9),
}
"""What is added to pitch and roll [deg], and the factor of the height."""

_ENTRIES = (
    "camera.height=[0.4, 1.2]",
    "camera.pitch=[8, 35]",
    "camera.steep=0",
    "camera.roll=[-3, 3]",
    "camera.tumbled=0",
    "ground.photographed=0",
    "ball.distance=[0.4, 5]",
)
_KINDS = {
    "field": (),
    "empty": ("ball.missing=1", "things.robots=[0, 0]", "things.people=[0, 0]", "field.goals=0"),
    "crowded": ("things.people=[2, 4]", "things.distance=[1, 5]"),
}


def kind_of(number: int) -> str:
    """What a recording shows."""
    return "field" if number < RECORDINGS else "empty" if number < RECORDINGS + EMPTY else "crowded"


def steps_of(scene: Scene, number: int) -> Iterator[Scene]:
    """The pictures of a recording: the camera goes 1 m, looks around, and sways with each of five steps."""
    random = np.random.default_rng([SEED, number])
    start, way = scene.orientation, random.uniform(-math.pi, math.pi)
    scan, phase = math.radians(random.uniform(20.0, 60.0)), random.uniform(0.0, 2.0 * math.pi, 4)
    for picture in range(PICTURES):
        share = picture / (PICTURES - 1)
        sway = np.sin(2.0 * math.pi * 5.0 * share + phase)
        turn = scan * math.sin(2.0 * math.pi * share + phase[3])
        orientation = Orientation.from_roll_pitch(
            start.height + 0.015 * float(sway[0]),
            start.roll + math.radians(2.0 * float(sway[1])),
            start.pitch + math.radians(2.0 * float(sway[2]) + 6.0 * math.sin(4.0 * math.pi * share)),
            start.yaw + turn,
        )
        gone = (share - 0.5) * np.array([math.cos(way), math.sin(way), 0.0])
        yield replace(_moved(scene, -gone), orientation=orientation)


def _moved(scene: Scene, by: np.ndarray) -> Scene:
    """The scene with everything but the camera moved by (3,) [m]."""
    field = scene.field
    assert field is not None
    x, y = field.middle
    mesh = scene.mesh
    vertices = (mesh.vertices + by).astype(mesh.vertices.dtype)
    return replace(
        scene,
        field=replace(field, middle=(x + float(by[0]), y + float(by[1]))),
        ball=None if scene.ball is None else replace(scene.ball, center=scene.ball.center + by),
        other=None if scene.other is None else replace(scene.other, center=scene.other.center + by),
        mesh=JoinedBodies(**{**vars(mesh), "vertices": vertices}),
    )


def render_recording(maps: tuple[Path, ...], out: Path, number: int) -> None:
    """Render the pictures of a recording that are missing."""
    folder, kind = out / f"{number:03d}", kind_of(number)
    if (folder / f"scene{PICTURES - 1:07d}.json").exists():
        return
    folder.mkdir(parents=True, exist_ok=True)
    configuration = read_sections(SceneConfiguration, SCENES, parse_overrides([*_ENTRIES, *_KINDS[kind]], ""))
    scene, environment = scene_of(Job(folder, maps, SEED, configuration), number)
    if kind == "empty":
        assert scene.field is not None  # nothing but carpet as far as the camera sees
        scene = replace(
            scene, field=replace(scene.field, length=100.0, width=80.0, border=math.inf, middle=(0.0, 20.0))
        )
    tracer = Tracer()
    for index, each in enumerate(steps_of(scene, number)):
        write_picture(folder, index, environment.name, each, render(each, environment, tracer, configuration.ground))


def verdicts(out: Path, number: int, error: str) -> list[str]:
    """What the check says after each picture of a recording with this error."""
    pitch, roll, factor = ERRORS[error]
    random = np.random.default_rng([SEED, number, 1])
    radius = json.loads((out / f"{number:03d}" / "scene0000000.json").read_text())["ball_radius"]
    detector = Detector.from_file("soccer", Settings(object_radius=radius))
    check, found = PoseCheck(), []
    for index in range(PICTURES):
        folder = out / f"{number:03d}"
        camera = read_lens_file(folder / f"lens{index:07d}.yaml")
        noise = NOISE * random.standard_normal(2)
        assert camera.orientation is not None
        given = camera.orientation.adjusted(
            math.radians(pitch) + float(noise[0]), math.radians(roll) + float(noise[1]), factor
        )
        seen = detector.detect(read_image(folder / f"image{index:07d}.jpg"), given, camera.lens)
        pose = check.update(seen).pose
        assert pose is not None
        found.append(pose.verdict)
    return found


def measure(out: Path, number: int) -> dict[str, list[str]]:
    """The verdicts on a recording with each error."""
    return {error: verdicts(out, number, error) for error in ERRORS}


def summary(found: dict[int, dict[str, list[str]]]) -> dict[str, Any]:
    """In how many recordings of each kind an error was called doubtful or wrong, and the verdict at the end."""
    table: dict[str, Any] = {}
    for kind in _KINDS:
        numbers = [each for each in found if kind_of(each) == kind]
        table[kind] = {"recordings": len(numbers)}
        for error in ERRORS:
            ever = [{"doubtful", "wrong"} & set(found[each][error]) for each in numbers]
            table[kind][error] = {
                "doubtful or wrong": sum(map(bool, ever)),
                "wrong": sum("wrong" in each for each in ever),
                "at the end": dict(Counter(found[each][error][-1] for each in numbers)),
            }
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hdri", type=Path, help="folder of maps")
    parser.add_argument("out", type=Path, help="folder for the recordings")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    configuration = read_sections(SceneConfiguration, SCENES, {})
    maps = tuple(find_maps(options.hdri, configuration.maps, True))
    numbers = range(RECORDINGS + EMPTY + CROWDED)
    with ProcessPoolExecutor(options.workers) as pool:
        for done, _ in enumerate(pool.map(partial(render_recording, maps, options.out), numbers), 1):
            print(f"{done} of {len(numbers)} recordings rendered", flush=True)
        found = dict(enumerate(pool.map(partial(measure, options.out), numbers)))
    command = "python -m benchmarks.pose_check HDRI OUT"
    result = {"command": command, "seed": SEED, "pictures": PICTURES, "summary": summary(found)}
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result["summary"], indent=1))


if __name__ == "__main__":
    main()
