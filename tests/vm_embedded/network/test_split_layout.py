"""Sectors of a mesh give the answers of the whole mesh, whatever the network, the mesh and the view."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.drawn_scenes import FOLDER
from vm_embedded import Detector, Settings, read_lens_file
from vm_embedded.errors import ModelError
from vm_embedded.geometry.shapes import Sphere
from vm_embedded.mesh.models import MESH_MODELS, build_mesh
from vm_embedded.network.choose_layout import choose_layout
from vm_embedded.network.layout import WholeLayout
from vm_embedded.network.session import Session
from vm_embedded.network.split_layout import SplitLayout, sectors_of, with_surroundings
from vm_export.network_shape import Layer, NetworkShape

from ..strategies import seeds
from .test_layout import (
    MODELS,
    WHOLE,
    answers,
    masks,
    models,
    network_of,
    network_shapes,
    random_meshes,
    ring_meshes,
    session_of,
    slot_colors,
)

DEMO = FOLDER.parent / "demo"

counts = st.integers(2, 4)


@pytest.fixture(scope="module")
def others():
    with ThreadPoolExecutor(3) as executor:
        yield executor


def split(session, mesh, count, executor):
    manifest = session.model.manifest
    sectors = sectors_of(mesh, count, session.model.depth)
    return SplitLayout(mesh, sectors, lambda part: choose_layout(part, manifest), executor)


def convolutions(network):
    return sum(layer.kind != "dense" for layer in network.shape.layers)


@pytest.mark.long
@given(st.data(), models, counts, seeds)
@settings(max_examples=60)
def test_sectors_give_the_answers_of_the_whole_mesh(others, data, model, count, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    is_any = data.draw(st.booleans())
    mesh, seen = (
        (data.draw(random_meshes(MESH_MODELS[model].neighbors)), None) if is_any else data.draw(ring_meshes(model))
    )
    on_screen = data.draw(masks(len(mesh), seen))
    colors = np.random.default_rng(seed).random((len(mesh), 3))
    for layout in ("plain", "runs"):
        session = session_of(network, model, layout)
        expected, whole = answers(session, mesh, colors, on_screen)
        parts = split(session, mesh, count, others)
        shown = np.append(on_screen, False)[parts.slots]
        found = session.run(parts, slot_colors(parts, colors, shown), shown)
        assert found.shape == (len(parts), network.shape.classes)
        np.testing.assert_allclose(
            found[parts.places][on_screen], expected[whole.places][on_screen], rtol=0, atol=1e-6, err_msg=layout
        )


@given(st.data(), models, counts, st.integers(0, 5))
def test_each_point_is_an_original_once_and_keeps_its_ray_and_its_links(others, data, model, count, depth):
    mesh, _ = data.draw(ring_meshes(model))
    sectors = sectors_of(mesh, count, depth)
    parts = SplitLayout(mesh, sectors, lambda part: choose_layout(part, manifest_for(model)), others)
    np.testing.assert_array_equal(np.sort(parts.slots[parts.original]), np.arange(len(mesh)))
    np.testing.assert_array_equal(parts.slots[parts.places], np.arange(len(mesh)))
    assert parts.original[parts.places].all()
    np.testing.assert_array_equal(parts.rays[parts.places], mesh.rays)
    point_of = np.append(parts.slots, len(mesh))
    np.testing.assert_array_equal(point_of[parts.links(parts.places)], mesh.neighbors[:-1])


def manifest_for(model):
    return session_of(
        network_of(NetworkShape.uniform(1, 2, 2, neighbors=MESH_MODELS[model].neighbors), 0), model, "runs"
    ).model.manifest


@given(st.data(), models, st.integers(0, 6), seeds)
def test_the_surroundings_are_all_points_so_many_links_away(data, model, depth, seed):
    mesh = data.draw(random_meshes(MESH_MODELS[model].neighbors))
    own = np.flatnonzero(np.random.default_rng(seed).random(len(mesh)) < 0.2)
    reached = set(own.tolist())
    for _ in range(depth):
        reached |= {int(each) for point in reached for each in mesh.neighbors[point]} - {len(mesh)}
    assert with_surroundings(mesh, own, depth).tolist() == sorted(reached)


@given(st.data(), models, seeds)
@settings(max_examples=30)
def test_the_depth_of_a_model_is_its_number_of_convolutions(data, model, seed):
    network = network_of(data.draw(network_shapes(model)), seed)
    for layout in ("plain", "runs"):
        assert session_of(network, model, layout).model.depth == convolutions(network)


def test_a_large_view_is_split_and_a_small_one_is_not(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    layers = (*(Layer("convolution", 32, "selu"),) * 3, Layer("convolution", 2, "softmax"))
    made = session_of(network_of(NetworkShape(layers, 6), 0), "ring6", "runs", operations=50_000)
    session = Session(made.model, threads=2)
    mesh = build_mesh(Sphere(0.1), 0.8, 4.0, 5.0, "ring6")
    assert session.threads == 2
    assert 50_000 * len(mesh) > 2 * 30e6
    assert isinstance(session.arrange(mesh), SplitLayout)
    assert isinstance(session.arrange(mesh.part(np.arange(1000))), WholeLayout)
    assert isinstance(made.arrange(mesh), WholeLayout)
    deep = session_of(network_of(NetworkShape.uniform(40, 2, 2), 0), "ring6", "runs", operations=50_000)
    around = Session(deep.model, threads=2).arrange(mesh)
    assert isinstance(around, WholeLayout), "each sector would be nearly the whole mesh"


def test_surroundings_of_any_depth_end_where_the_mesh_ends():
    mesh = WHOLE["ring6"]
    everything = with_surroundings(mesh, np.arange(3), 10**9)
    assert everything.tolist() == list(range(len(mesh)))


def test_without_a_thread_the_call_ends_in_one_line(monkeypatch):
    network = network_of(NetworkShape.uniform(2, 4, 2), 0)
    session = session_of(network, "ring6", "runs")

    class Full:
        def submit(self, *_):
            raise RuntimeError("can't start new thread")

    parts = split(session, WHOLE["ring6"], 2, Full())
    colors = np.full((3, len(parts)), 0.5, dtype=np.float32)
    with pytest.raises(ModelError, match="can't run it in 1 threads: can't start new thread"):
        session.run(parts, colors, parts.slots < len(WHOLE["ring6"]))


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_without_the_threads_is_told_to_load_its_own_detector(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {0, 1})
    file, image = read_lens_file(DEMO / "lens0000002.yaml"), cv2.imread(str(DEMO / "image0000002.jpg"))
    detector = Detector.from_file("soccer", Settings(threads=2))
    detector.detect(image, file.orientation, file.lens)
    child = os.fork()
    if not child:
        signal.alarm(20)  # ends the child if it waits for threads that it does not have
        status = 1
        try:
            detector.detect(image, file.orientation, file.lens)
        except ModelError:
            status = 0
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_a_detector_finds_the_same_with_two_threads(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    camera = read_lens_file(DEMO / "lens0000002.yaml")
    image = cv2.imread(str(DEMO / "image0000002.jpg"))
    one, two = (Detector.from_file("soccer", Settings(threads=count)) for count in (1, 2))
    for each in (one, two, two):  # the second time from the cache
        found = each.detect(image, camera.orientation, camera.lens)
        if each is one:
            expected = found
    assert isinstance(found.observation.layout, SplitLayout)
    assert two.cache.hits == 1
    assert len(found.objects) == len(expected.objects) > 0
    np.testing.assert_array_equal(found.pixels, expected.pixels)
    np.testing.assert_allclose(found.observation.probabilities, expected.observation.probabilities, atol=1e-6)
    assert [each.distance for each in found.objects] == pytest.approx([each.distance for each in expected.objects])
    size = (image.shape[1], image.shape[0])
    assert two.prepare_nearby(camera.orientation, camera.lens, size)


@pytest.mark.parametrize("fails", [0, 1])
def test_an_error_in_a_sector_is_the_error_of_the_call(others, fails):
    network = network_of(NetworkShape.uniform(2, 4, 2), 0)
    session = session_of(network, "ring6", "runs")
    parts = split(session, WHOLE["ring6"], 2, others)
    caller, run = threading.get_ident(), session.onnx.run

    def failing(feeds):
        if (threading.get_ident() != caller) == bool(fails):
            raise ModelError("broken")
        return run(feeds)

    colors = np.full((3, len(parts)), 0.5, dtype=np.float32)
    with pytest.raises(ModelError, match="broken"):
        parts.answers(failing, colors, parts.slots < len(WHOLE["ring6"]))
    assert np.isfinite(parts.answers(run, colors, parts.slots < len(WHOLE["ring6"]))).all()


@pytest.mark.parametrize("model", MODELS)
def test_what_sectors_hold_is_counted(others, model):
    session = session_of(
        network_of(NetworkShape.uniform(2, 4, 2, neighbors=MESH_MODELS[model].neighbors), 0), model, "runs"
    )
    whole = choose_layout(WHOLE[model], session.model.manifest)
    parts = split(session, WHOLE[model], 2, others)
    assert parts.nbytes > whole.nbytes + WHOLE[model].neighbors.nbytes
    assert parts.rays.T.flags.c_contiguous
