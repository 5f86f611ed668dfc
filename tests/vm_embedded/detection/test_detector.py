"""The whole call: what is prepared never changes an answer, and broken networks are refused."""

import json
from dataclasses import replace

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import helper

from tests.drawn_scenes import FOLDER, IMAGES, MODEL
from vm_embedded import Detector, GeometryError, InputError, ModelError, Orientation, Settings, read_lens_file
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.footprint import levels_for
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.mesh.mesh import Mesh
from vm_embedded.network.choose_layout import PlainLayout, choose_layout
from vm_embedded.network.manifest import METADATA_KEY
from vm_embedded.network.model_file import SEAL_KEY, read_model, sealed


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
        height = fresh.cache.mesh_height(orientation.height)
        mesh = fresh.cache._build(height)
        levels = levels_for(fresh.manifest, mesh, height, lens)
        return view._replace(mesh=mesh, layout=choose_layout(mesh, fresh.manifest), levels=levels)

    fresh.cache.view = whole
    return fresh.detect(image, orientation, lens)


@pytest.mark.long
@given(
    index=st.integers(0, 5),
    pitch=st.floats(-0.5, 0.5),
    roll=st.floats(-0.5, 0.5),
    steps=st.floats(0.01, 0.3),
)
@settings(max_examples=25)
def test_a_bucket_never_changes_an_answer(index, pitch, roll, steps):
    image, orientation, lens = frame(index)
    detector = Detector(read_model(MODEL), Settings(pitch_step=steps, roll_step=steps))
    # Anywhere in its bucket, from the frame's own orientation on.
    turned = Orientation.from_roll_pitch(
        orientation.height, orientation.roll + roll * steps, orientation.pitch + pitch * steps, orientation.yaw
    )
    ours = detector.detect(image, turned, lens)
    again = detector.detect(image, turned, lens)
    theirs = without_bucket(detector, image, turned, lens)
    for other in (again, theirs):
        np.testing.assert_array_equal(ours.rays, other.rays)
        np.testing.assert_array_equal(ours.pixels, other.pixels)
        np.testing.assert_array_equal(ours.probabilities, other.probabilities)
        assert [each.as_dict() for each in ours] == [each.as_dict() for each in other]
    assert detector.cache.hits == 1


@pytest.mark.parametrize("tolerance", [0.0, 0.5])
def test_a_camera_that_looks_at_the_sky_sees_nothing_and_says_so(tolerance):
    image, orientation, lens = frame()
    detector = Detector.from_file(MODEL, Settings(height_tolerance=tolerance))
    found = detector.detect(image, Orientation.from_roll_pitch(orientation.height, pitch=-1.5), lens, explain=True)
    assert (len(found), len(found.rejected)) == (0, 0)
    assert found.rays.shape == (0, 3)
    assert found.pixels.shape == (0, 2)
    assert found.probabilities.shape == (0, len(detector.manifest.classes))
    assert len(found.points_of("field")) == 0


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


def test_the_mesh_reaches_as_far_as_it_is_told(detector):
    image, orientation, lens = frame()
    whole = detector.detect(image, orientation, lens)
    assert detector.manifest.max_distance > 2.0
    near = Detector.from_file(MODEL, Settings(max_distance=2.0)).detect(image, orientation, lens)
    reach = near.rays[:, :2] / -near.rays[:, 2:] * orientation.height
    assert 1.8 < np.hypot(*reach.T).max() < 2.0
    assert 0 < len(near.pixels) < len(whole.pixels)


def test_detections_iterate_and_have_a_length(detector):
    found = detector.detect(*frame())
    assert len(found) == len(list(found)) >= 1
    assert found[0] is next(iter(found))
    json.dumps([each.as_dict() for each in found], allow_nan=False)
    assert set(found.timing_ms) == {"mesh", "project", "sample", "infer", "cluster", "field", "total"}


def test_class_points_are_those_above_the_threshold(detector):
    found = detector.detect(*frame())
    field = found.points_of("field")
    column = detector.manifest.column("field")
    assert len(field) == (found.probabilities[:, column] > 0.5).sum()
    np.testing.assert_allclose(np.linalg.norm(field.bearings, axis=1), 1.0)
    with pytest.raises(InputError, match="field"):
        found.points_of("fields")


def test_gray_and_flipped_channels_are_read_as_said(detector):
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
    with pytest.raises(InputError, match=r"must be a Lens, as read_lens_file\(PATH\)\.lens, not LensFile"):
        detector.detect(image, orientation, LensFile(lens, orientation))
    with pytest.raises(InputError, match=r"read_lens_file\(PATH\)\.orientation, not LensFile"):
        detector.detect(image, LensFile(lens, orientation), lens)


def changed(path, change, source=MODEL):
    """A copy of a model with something changed in it."""
    model = onnx.load(source)
    change(model)
    kept = {each.key: each.value for each in model.metadata_props if each.key != SEAL_KEY}
    helper.set_model_props(model, kept)
    path.write_bytes(sealed(model.SerializeToString()))
    return path


def claim(**entries):
    """A change of what a model says about itself."""

    def change(model):
        manifest = json.loads(next(each.value for each in model.metadata_props if each.key == METADATA_KEY))
        helper.set_model_props(model, {METADATA_KEY: json.dumps(manifest | entries)})

    return change


def test_a_network_that_answers_its_self_test_wrongly_is_refused(tmp_path):
    def break_weights(model):
        weights = next(each for each in model.graph.initializer if each.name == "layer0.kernel")
        weights.CopyFrom(onnx.numpy_helper.from_array(-onnx.numpy_helper.to_array(weights), weights.name))

    with pytest.raises(ModelError, match="self-test failed"):
        Detector.from_file(changed(tmp_path / "model.onnx", break_weights, MODEL))


@pytest.mark.parametrize("width", [0, 4, 8])
def test_a_self_test_of_another_mesh_is_refused(width, tmp_path):
    test = read_model(MODEL).manifest.self_test.as_dict()
    other = [(row + row)[:width] for row in test["neighbors"]]
    with pytest.raises(ModelError):
        Detector.from_file(changed(tmp_path / "model.onnx", claim(self_test=test | {"neighbors": other}), MODEL))


def test_a_network_with_other_inputs_than_its_manifest_is_refused(tmp_path):
    for mesh in ("ring8", "octaves"):
        with pytest.raises(ModelError, match="inputs and outputs"):
            Detector.from_file(changed(tmp_path / "model.onnx", claim(mesh=mesh), MODEL))


def test_a_network_with_an_unknown_operator_is_refused(tmp_path):
    def rename(model):
        model.graph.node[0].op_type = "Conjure"

    with pytest.raises(ModelError, match="ONNX Runtime can't load it"):
        Detector.from_file(changed(tmp_path / "model.onnx", rename))


class Broken(PlainLayout):
    """A layout that hands out indices which no point has."""

    def feeds(self, colors, on_screen):
        feeds = super().feeds(colors, on_screen)
        return feeds | {"neighbors": np.full_like(feeds["neighbors"], 99)}


def small_mesh():
    """Four points in a ring, each with two neighbors and four missing ones."""
    neighbors = np.full((5, 6), 4, dtype=np.int32)
    neighbors[:4, :2] = [[1, 2], [2, 3], [3, 0], [0, 1]]
    return Mesh(np.zeros((4, 3)), neighbors)


def test_neighbors_out_of_range_are_an_error_and_not_a_crash():
    session = Detector.from_file(MODEL).session
    broken = Broken(small_mesh(), "hard")
    colors = np.zeros((3, 4), dtype=np.float32)
    with pytest.raises(ModelError, match="can't run"):
        session.run(broken, colors, np.ones(4, dtype=bool), np.arange(4))


def test_the_edge_policy_same_links_missing_neighbors_to_the_point_itself(tmp_path):
    hard = Detector.from_file(MODEL).session
    same = Detector.from_file(changed(tmp_path / "model.onnx", claim(edge="same"), MODEL)).session
    mesh = small_mesh()
    alone = Mesh(mesh.rays, np.where(mesh.neighbors == 4, np.arange(5, dtype=np.int32)[:, None], mesh.neighbors))
    colors = np.random.default_rng(0).random((4, 3)).astype(np.float32)

    def answers(session, mesh, shown=(True, True, True, True)):
        layout = choose_layout(mesh, session.model.manifest)
        return session.run(layout, colors.T, np.array(shown), np.arange(4))

    np.testing.assert_array_equal(answers(same, mesh), answers(hard, alone))
    assert np.abs(answers(same, mesh) - answers(hard, mesh)).max() > 1e-3
    # A neighbor off screen is a missing one: 0 led to 1 and 2, and 3 to 0 and 1.
    alone.neighbors[0, 0], alone.neighbors[3, 1] = 0, 3
    found, expected = (answers(*each)[[0, 2, 3]] for each in ((same, mesh, (True, False, True, True)), (hard, alone)))
    np.testing.assert_array_equal(found, expected)


def test_the_model_s_facts_are_readable():
    model = read_model(MODEL)
    assert len(model.sha256) == 64
    assert [each.name for each in model.manifest.classes] == ["ball", "line", "field", "environment"]


def test_the_name_of_a_network_in_place_of_its_file_is_refused():
    with pytest.raises(InputError, match=r"model must be a ModelFile, not 'ball'; Detector\.from_file takes names"):
        Detector("ball")
    with pytest.raises(InputError, match=r"settings must be Settings\(...\), not {'threads': 1}"):
        Detector.from_file("ball", {"threads": 1})
