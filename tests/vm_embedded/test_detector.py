"""The whole call: what is prepared never changes an answer, and broken networks are refused."""

import json
from dataclasses import replace

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import helper

import vm_embedded
from tests.demo import FOLDER, IMAGES, MODEL
from vm_embedded import Detector, GeometryError, InputError, ModelError, Orientation, Settings, read_lens_file
from vm_embedded.cache import View
from vm_embedded.manifest import METADATA_KEY
from vm_embedded.onnx_file import read_model
from vm_embedded.sources import read_image


@pytest.fixture(scope="module")
def detector():
    return Detector.from_file(MODEL)


def frame(index=0):
    file = read_lens_file(FOLDER / f"lens{index:07d}.yaml")
    return read_image(IMAGES[index]), file.orientation, file.lens


def without_bucket(detector, image, orientation, lens):
    """Detections with the whole mesh of the same height instead of what a bucket holds of it."""
    fresh = Detector(detector.session.model, detector.settings)
    prepared = fresh.cache.view

    def whole(orientation, lens, size):
        view = prepared(orientation, lens, size)
        return View(fresh.cache._build(view.mesh_height), view.mesh_height, view.rotation, view.heading)

    fresh.cache.view = whole
    return fresh.detect(image, orientation, lens)


@given(
    index=st.integers(0, 5),
    pitch=st.floats(-0.5, 0.5),
    roll=st.floats(-0.5, 0.5),
    steps=st.floats(0.01, 0.3),
)
@settings(max_examples=25)
def test_a_bucket_never_changes_an_answer(detector, index, pitch, roll, steps):
    image, orientation, lens = frame(index)
    detector = Detector(detector.session.model, Settings(pitch_step=steps, roll_step=steps))
    # Anywhere in its bucket, from the frame's own orientation on.
    turned = Orientation.from_roll_pitch(
        orientation.height, orientation.roll + roll * steps, orientation.pitch + pitch * steps, orientation.yaw
    )
    ours = detector.detect(image, turned, lens)
    again = detector.detect(image, turned, lens)
    theirs = without_bucket(detector, image, turned, lens)
    for other in (again, theirs):
        np.testing.assert_array_equal(ours.pixels, other.pixels)
        np.testing.assert_array_equal(ours.probabilities, other.probabilities)
        assert [each.as_dict() for each in ours] == [each.as_dict() for each in other]
    assert detector.cache.hits == 1


def test_yaw_turns_positions_and_nothing_else(detector):
    image, orientation, lens = frame()
    turned = Orientation.from_roll_pitch(
        orientation.height, orientation.roll, orientation.pitch, orientation.yaw + np.pi / 2
    )
    before, after = (detector.detect(image, each, lens) for each in (orientation, turned))
    x, y, z = before[0].position
    np.testing.assert_allclose(after[0].position, (-y, x, z), atol=1e-3)
    np.testing.assert_allclose(after[0].center, before[0].center, atol=0.05)
    np.testing.assert_allclose(after.pixels, before.pixels, atol=1e-6)


def test_own_meshes_and_shared_ones_find_the_same_balls():
    for index in range(len(IMAGES)):
        shared_mesh = Detector.from_file(MODEL).detect(*frame(index))
        own_mesh = Detector.from_file(MODEL, Settings(height_tolerance=0.0)).detect(*frame(index))
        assert shared_mesh[0].distance == pytest.approx(own_mesh[0].distance, rel=0.05)


def test_detections_iterate_and_have_a_length(detector):
    found = detector.detect(*frame())
    assert len(found) == len(list(found)) >= 1
    assert found[0] is next(iter(found))
    json.dumps([each.as_dict() for each in found], allow_nan=False)
    assert set(found.timing_ms) == {"mesh", "project", "sample", "infer", "cluster", "total"}


def test_class_points_are_those_above_the_threshold(detector):
    found = detector.detect(*frame())
    field = found.points_of("field")
    column = detector.manifest.column("field")
    assert len(field) == (found.probabilities[:, column] > 0.5).sum()
    np.testing.assert_allclose(np.linalg.norm(field.bearings, axis=1), 1.0)
    with pytest.raises(InputError, match="field"):
        found.points_of("fields")


def test_grey_and_flipped_channels_are_read_as_said(detector):
    image, orientation, lens = frame()
    reference = detector.detect(image, orientation, lens)
    rgb = Detector.from_file(MODEL, Settings(format="rgb")).detect(image[:, :, ::-1], orientation, lens)
    np.testing.assert_array_equal(rgb.probabilities, reference.probabilities)


def test_bad_frames_are_refused(detector):
    image, orientation, lens = frame()
    for bad in (image[:, :, 0], image.astype(float), image[:1], None):
        with pytest.raises(InputError, match="image"):
            detector.detect(bad, orientation, lens)
    with pytest.raises(GeometryError, match="diameter"):
        detector.detect(image, Orientation.from_roll_pitch(0.1), lens)
    with pytest.raises(InputError, match="proportions"):
        detector.detect(image, orientation, replace(lens, size=(100, 100)))


def changed(path, change):
    """A copy of the demo's model with something changed in it."""
    model = onnx.load(MODEL)
    change(model)
    onnx.save(model, path)
    return path


def test_a_network_that_answers_its_self_test_wrongly_is_refused(tmp_path):
    def break_weights(model):
        weights = next(each for each in model.graph.initializer if each.name == "layer0.kernel")
        weights.CopyFrom(onnx.numpy_helper.from_array(-onnx.numpy_helper.to_array(weights), weights.name))

    with pytest.raises(ModelError, match="self-test failed"):
        Detector.from_file(changed(tmp_path / "model.onnx", break_weights))


def test_a_network_with_other_inputs_than_its_manifest_is_refused(tmp_path):
    def claim_another_mesh(model):
        manifest = json.loads(next(each.value for each in model.metadata_props if each.key == METADATA_KEY))
        helper.set_model_props(model, {METADATA_KEY: json.dumps(manifest | {"mesh": "ring8"})})

    with pytest.raises(ModelError, match="inputs and outputs"):
        Detector.from_file(changed(tmp_path / "model.onnx", claim_another_mesh))


def test_a_network_with_an_unknown_operator_is_refused(tmp_path):
    def rename(model):
        model.graph.node[0].op_type = "Conjure"

    with pytest.raises(ModelError, match="ONNX Runtime can't load it"):
        Detector.from_file(changed(tmp_path / "model.onnx", rename))


def test_neighbors_out_of_range_are_an_error_and_not_a_crash():
    session = Detector.from_file(MODEL).session
    points = np.zeros((3, 3), dtype=np.float32)
    with pytest.raises(ModelError, match="can't run"):
        session.run(points, np.full((3, 6), 99, dtype=np.int32))


def test_the_edge_policy_same_links_missing_neighbors_to_the_point_itself(tmp_path):
    def claim_same(model):
        manifest = json.loads(next(each.value for each in model.metadata_props if each.key == METADATA_KEY))
        helper.set_model_props(model, {METADATA_KEY: json.dumps(manifest | {"edge": "same"})})

    hard = Detector.from_file(MODEL).session
    same = Detector.from_file(changed(tmp_path / "model.onnx", claim_same)).session
    points = np.vstack([np.random.default_rng(0).random((4, 3)), -np.ones((1, 3))]).astype(np.float32)
    neighbors = np.full((5, 6), 4, dtype=np.int32)
    neighbors[:4, :2] = [[1, 2], [2, 3], [3, 0], [0, 1]]
    alone = np.where(neighbors == 4, np.arange(5, dtype=np.int32)[:, None], neighbors)
    np.testing.assert_array_equal(same.run(points, neighbors), hard.run(points, alone))
    assert np.abs(same.run(points, neighbors) - hard.run(points, neighbors)).max() > 1e-3


def test_the_three_lines_of_the_readme_work():
    readme = (FOLDER.parents[2] / "README.md").read_text()
    program = readme.split("```python\n")[1].split("```")[0]
    names = {"image": frame()[0], "lens": frame()[2], "orientation": frame()[1]}
    exec(program.replace('"ball.onnx"', repr(str(MODEL))), names)
    assert vm_embedded.__version__ == "0.1.0"


def test_the_model_s_facts_are_readable():
    model = read_model(MODEL)
    assert len(model.sha256) == 64
    assert [each.name for each in model.manifest.classes] == ["ball", "line", "field", "environment"]
