"""Does the pose check tell right poses from wrong ones? `python -m benchmarks.pose_check HDRI OUT`.

Renders recordings of cameras that walk over fields, turn and sway, then detects with soccer as on a robot, with the
right poses and with a constant error of each kind. A recording has 33 pictures: the daemon looks at every third frame,
so these are 100 frames. Some recordings show an empty carpet without lines, some people beside it. Poses have an error
of 0.3 degrees in each picture, as those of joints do. Then `vm-calibrate pose` fits the error of a mount to each
recording of a field. Writes benchmarks/pose_check.json. Recordings that are there already are not rendered again.
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

from vm_calibrate.field_pose import fit_field
from vm_embedded import Detector
from vm_embedded.cameras.image_files import read_image
from vm_embedded.config.sections import parse_overrides, read_sections
from vm_embedded.detection.pose_check import PoseCheck
from vm_embedded.detection.pose_search import View
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError
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

MOUNT = (2.0, -1.5, 1.08)
"""The error of a mount that is fitted: of pitch and roll [deg], and the factor of the height."""

_FEWEST, _FEWEST_BALLS = 30, 3
"""Pieces of lines that a recording must show for a fit, and balls for a height."""

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
        assert scene.field is not None  # no line is nearer than 40 m
        large = replace(scene.field, length=300.0, width=240.0, border=math.inf)
        x, y = (large.rotation @ (-40.0, -60.0)).tolist()
        scene = replace(scene, field=replace(large, middle=(x, y)))
    tracer = Tracer()
    for index, each in enumerate(steps_of(scene, number)):
        write_picture(folder, index, environment.name, each, render(each, environment, tracer, configuration.ground))


def views_of(folder: Path, error: tuple[float, float, float]) -> list[View]:
    """The pictures of a recording, with poses that have an error of pitch and roll [deg] and height [factor]."""
    random = np.random.default_rng([SEED, int(folder.name), 1])
    views = []
    for index in range(PICTURES):
        camera = read_lens_file(folder / f"lens{index:07d}.yaml")
        assert camera.orientation is not None
        pitch, roll = np.radians(error[:2]) + NOISE * random.standard_normal(2)
        given = camera.orientation.adjusted(float(pitch), float(roll), error[2])
        views.append(View(read_image(folder / f"image{index:07d}.jpg"), camera.lens, given))
    return views


def radius_of(folder: Path) -> float:
    """The radius of the balls of a recording [m]."""
    return float(json.loads((folder / "scene0000000.json").read_text())["ball_radius"])


def verdicts(folder: Path, error: str) -> list[str]:
    """What the check says after each picture of a recording with this error."""
    detector = Detector.from_file("soccer", Settings(object_radius=radius_of(folder)))
    check, found = PoseCheck(), []
    for each in views_of(folder, ERRORS[error]):
        pose = check.update(detector.detect(each.image, each.orientation, each.lens)).pose
        assert pose is not None
        found.append(pose.verdict)
    return found


def fit(folder: Path) -> dict[str, float]:
    """How far the fit of a mount is off: pitch and roll [deg], height [%], and the pieces of lines it rests on."""
    found = fit_field(views_of(folder, MOUNT), True, "soccer", radius_of(folder), None)
    pitch, roll, height = found.errors.tolist()
    return {
        "lines": found.tried.lines,
        "balls": found.tried.balls,
        "pitch": math.degrees(pitch) + MOUNT[0],
        "roll": math.degrees(roll) + MOUNT[1],
        "height": 100.0 * (math.exp(height) * MOUNT[2] - 1.0),
    }


def measure(out: Path, number: int) -> dict[str, Any]:
    """The verdicts on a recording with each error, and the fit of a mount if it shows a field."""
    folder = out / f"{number:03d}"
    found: dict[str, Any] = {error: verdicts(folder, error) for error in ERRORS}
    if kind_of(number) == "field":
        try:
            found["fit"] = fit(folder)
        except InputError as error:
            found["fit"] = {"lines": 0, "fault": str(error)}
    return found


def summary(found: dict[int, dict[str, Any]]) -> dict[str, Any]:
    """In how many recordings of each kind an error was called doubtful or wrong, and the verdict at the end; and the
    median absolute errors of the fits."""
    fits = [each["fit"] for each in found.values() if "fit" in each and each["fit"]["lines"] >= _FEWEST]
    with_balls = [each for each in fits if each["balls"] >= _FEWEST_BALLS]
    table: dict[str, Any] = {
        "fits": {
            "recordings": len(fits),
            "with balls": len(with_balls),
            "pitch": float(np.median([abs(each["pitch"]) for each in fits])),
            "roll": float(np.median([abs(each["roll"]) for each in fits])),
            "height": float(np.median([abs(each["height"]) for each in with_balls])),
        }
    }
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
    result = {"command": command, "seed": SEED, "pictures": PICTURES, **summary(found)}
    result["fitted"] = [each["fit"] for each in found.values() if "fit" in each]
    RESULTS.write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(summary(found), indent=1))


if __name__ == "__main__":
    main()
