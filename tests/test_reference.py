"""The reference's golden answers, through the commands that a user types."""

import json

import cv2
import numpy as np
import pytest

from tests.messages import read_message
from tests.programs import run_program

SAME_POINTS = (0, 1, 3, 7, 8, 9, 11, 12, 13, 14)
RECEPTIVE_STEPS = 13
"""Convolutions of the reference's network: how far a differing point can reach."""


def run(*command):
    return run_program(*command).stdout


@pytest.fixture(scope="module")
def model(shared, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "model.onnx"
    facts = ("--intersections", 6, "--max-distance", 20, "--object-radius", 0.075)
    run("vm-export", shared / "reference/model.yaml", "-o", path, *facts)
    return path


@pytest.fixture(scope="module")
def points(shared, model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("points")
    exact = ("--height-tolerance", 0)
    run("vm-detect", "--camera", shared / "reference/images", "--model", model, "--save-points", folder, *exact)
    return folder


def matched(ours, theirs):
    """For each of our rays the position of the same one of theirs, or -1."""
    order = np.argsort(theirs[:, 2], kind="stable")
    height = theirs[order, 2]
    found = np.full(len(ours), -1)
    for position, ray in enumerate(ours):
        low, high = np.searchsorted(height, (ray[2] - 1e-6, ray[2] + 1e-6))
        near = order[low:high]
        if len(near):
            error = np.abs(theirs[near] - ray).max(axis=1)
            best = int(np.argmin(error))
            if error[best] < 2e-6:
                found[position] = near[best]
    return found


@pytest.mark.parametrize("index", range(15))
def test_points_pixels_and_probabilities_are_the_reference_s(shared, points, index):
    golden = np.load(shared / f"reference/golden/golden{index:07d}.npz")
    ours = np.load(points / f"image{index:07d}.npz")
    assert abs(len(ours["rays"]) - len(golden["rays"])) <= 3

    match = matched(ours["rays"], golden["rays"].astype(np.float64))
    both = match >= 0
    assert (~both).sum() <= 3
    assert np.abs(ours["pixels"][both] - golden["pixels"][match[both]]).max() < 1e-3

    error = np.abs(ours["probabilities"][both] - golden["probabilities"][match[both]]).max(axis=1)
    if index in SAME_POINTS:
        assert both.all()
        assert len(ours["rays"]) == len(golden["rays"])
        assert (error < 1e-3).mean() >= 0.999
    else:
        missing_there = np.flatnonzero(~both)
        assert len(missing_there)
        large = np.flatnonzero(both)[error >= 1e-3]
        steps = steps_from(missing_there, shared, index, ours["rays"])
        assert (steps[large] <= RECEPTIVE_STEPS).all()


def steps_from(sources, shared, index, rays):
    """Graph steps (n,) of each point on screen from the nearest of `sources`."""
    from vm_embedded.detection.projection import project
    from vm_embedded.geometry.lens_files import read_lens_file
    from vm_embedded.geometry.shapes import Sphere
    from vm_embedded.mesh.models import build_mesh

    file = read_lens_file(shared / f"reference/images/lens{index:07d}.yaml")
    mesh = build_mesh(Sphere(0.0949996), file.orientation.height, 6, 20.0)
    projected = project(mesh, file.orientation.rotation, file.lens, (1280, 1024)).visible
    np.testing.assert_allclose(projected.graph.rays, rays, atol=1e-12)
    neighbors = projected.graph.neighbors
    steps = np.full(len(neighbors), 1000)
    steps[sources] = 0
    for _ in range(RECEPTIVE_STEPS + 1):
        # The answer at a point depends on its neighbors, so a difference travels against the links.
        steps = np.minimum(steps, steps[neighbors].min(axis=1) + 1)
        steps[-1] = 1000  # everything off screen is one constant point, and passes nothing on
    return steps[:-1]


def score(shared, model, *options):
    """Balls found, balls in all, false balls and relative distance errors over the reference's images."""
    truth = json.loads((shared / "reference/balls.json").read_text())
    lines = run("vm-detect", "--camera", shared / "reference/images", "--model", model, *options).splitlines()
    assert len(lines) == 15
    hits, false, errors = set(), 0, []
    for line in map(read_message, lines):
        ball = truth.get(line["source"])
        for found in line["detections"]:
            near = ball and np.hypot(found["center"][0] - ball["cx"], found["center"][1] - ball["cy"]) < ball["r_px"]
            if near and line["source"] not in hits:
                hits.add(line["source"])
                errors.append(abs(found["distance"] / ball["dist"] - 1.0))
            else:
                false += 1
    return len(hits), len(truth), false, errors


@pytest.mark.parametrize("options", [(), ("--height-tolerance", "0")], ids=str)
def test_the_authors_network_finds_the_balls(shared, model, options):
    hits, balls, false, errors = score(shared, model, *options)
    assert balls == 14
    assert hits >= 13
    assert false <= 10
    assert np.median(errors) < 0.03


@pytest.mark.long
def test_every_frame_of_the_real_cameras_is_processed(shared, model, tmp_path):
    overlay = ("--save-overlay", tmp_path)
    out = run("vm-detect", "--camera", shared / "real/images", "--model", model, "--object-radius", 0.11, *overlay)
    assert len(out.splitlines()) == 40
    assert len(list(tmp_path.glob("*.jpg"))) == 40
    assert cv2.imread(str(next(tmp_path.glob("*.jpg")))).shape == (800, 608, 3)
