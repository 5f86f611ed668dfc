"""A network with peaks: a file with all outputs is loaded, checked and run, and its peaks are in the picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.manifests import ball_manifest
from vm_embedded import Detector, Orientation
from vm_embedded.errors import ModelError
from vm_embedded.geometry.radial_lenses import Equisolid
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.example import SelfTest
from vm_embedded.network.manifest import METADATA_KEY
from vm_embedded.network.model_file import parse_model, sealed
from vm_embedded.network.session import Session

from ..strategies import SIZE

MANIFEST = ball_manifest("ball", "goal:upright", "other", mesh="octaves", max_distance=4.0, peaks=("goal", "ball"))
LENS = Equisolid(focal_length=220.0, fov=2.6)
KERNEL = np.zeros((MANIFEST.outputs, 4))
"""Red is the score of balls, green that of posts, and blue their size. Nothing is shifted."""
KERNEL[7, 0] = KERNEL[3, 1] = 20.0
KERNEL[[6, 10], 2] = 1.0
BIAS = np.zeros(MANIFEST.outputs)
BIAS[[3, 7]] = -10.0


def model(manifest):
    """A model file whose network mixes the colors of each cell."""
    from vm_export.onnx_graph import BOOL, FLOAT, OnnxGraph

    graph = OnnxGraph()
    shown = graph.node("Cast", ["shown"], "numbers", to=FLOAT)
    canvas = graph.node("Concat", ["points", shown], "canvas", axis=1)
    weights = [graph.constant("kernel", KERNEL[:, :, None, None]), graph.constant("bias", BIAS)]
    graph.node("Conv", [canvas, *weights], "probabilities")
    content = graph.model(
        {"points": (FLOAT, [1, 3, "rows", "columns"]), "shown": (BOOL, [1, 1, "rows", "columns"])},
        {"probabilities": (FLOAT, [1, len(KERNEL), "rows", "columns"])},
        {METADATA_KEY: manifest.as_json()},
        "a test",
    )
    return parse_model(Path("model.onnx"), sealed(content))


def self_test():
    """An example of five cells."""
    cells = np.stack([np.arange(5), np.arange(5) % 2], axis=1).astype(np.int32)
    points = np.append(np.random.default_rng(0).random((5, 3)).round(4), [[-1.0] * 3], axis=0).astype(np.float32)
    answer = (points @ KERNEL[:, :3].T + KERNEL[:, 3] + BIAS).astype(np.float32)
    return SelfTest(points, np.full((6, MANIFEST.neighbors), 5, dtype=np.int32), answer, cells)


def test_a_session_gives_all_outputs():
    session = Session(model(replace(MANIFEST, self_test=self_test())))
    mesh = MANIFEST.model.build(MANIFEST.mesh_shape, 0.6, 4.0, 4.0)
    layout = choose_layout(mesh, MANIFEST)
    random = np.random.default_rng(1)
    colors, points = random.random((3, len(mesh)), dtype=np.float32), random.permutation(len(mesh))[:100]
    spread = np.stack([layout.spread(each) for each in colors])
    found = session.run(layout, spread, np.ones(len(mesh), dtype=bool), points)
    assert found.shape == (100, MANIFEST.outputs)
    np.testing.assert_allclose(found, (colors.T @ KERNEL[:, :3].T + KERNEL[:, 3] + BIAS)[points], atol=1e-4)


def test_a_self_test_proves_the_peaks_too():
    test = self_test()
    for column in (3, 10):
        wrong = test.probabilities.copy()
        wrong[2, column] += 0.01
        with pytest.raises(ModelError, match="self-test failed"):
            Session(model(replace(MANIFEST, self_test=replace(test, probabilities=wrong))))
    classes_only = replace(test, probabilities=test.probabilities[:, :3])
    with pytest.raises(ModelError, match=r"self-test.*\(5, 11\)"):
        Session(model(replace(MANIFEST, self_test=classes_only)))


@pytest.mark.parametrize("peaks", [(), ("ball",)])
def test_a_network_with_other_outputs_than_its_manifest_says_is_refused(peaks):
    with pytest.raises(ModelError, match="its manifest asks for"):
        Session(model(replace(MANIFEST, peaks=peaks)))


def test_peaks_are_where_the_picture_shows_something():
    detector = Detector(model(MANIFEST))
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    spots = {"ball": (250.0, 330.0), "goal": (420.0, 260.0)}
    red, green = (np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2.0 * 12.0**2)) for u, v in spots.values())
    image = np.rint(255.0 * np.stack([np.full(red.shape, 0.4), green, red], axis=2)).astype(np.uint8)
    seen = detector.observe(image, Orientation.from_roll_pitch(0.6, 0.05, 0.5, 1.0), LENS)
    assert seen.probabilities.shape == (len(seen), 3)
    for name, pixel in spots.items():
        found = seen.peaks[name].part(slice(5))
        assert len(found) == 1
        np.testing.assert_allclose(seen.view.ray_pixels(found.rays), [pixel], atol=8.0)
        np.testing.assert_allclose(found.log_sizes, 0.4, atol=0.01)
    (post,) = detector.locate(seen).field.posts
    np.testing.assert_allclose(post.pixel, spots["goal"], atol=8.0)
    assert post.width == pytest.approx(0.2 * np.exp(0.4), rel=0.01)
