import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.manifests import ball_manifest
from vm_embedded.detection.cache import MeshCache
from vm_embedded.detection.projection import project
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import GeometryError
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant, Equisolid, Rectilinear
from vm_embedded.mesh.models import build_mesh

from ..strategies import SIZE, lenses, orientations, random_direction, reals, rotation, seeds

LENS = Equisolid(focal_length=300.0, fov=2.2)

MESHES = ("ring6", "octaves")
"""One on a graph and one on a canvas."""

in_all_layouts = pytest.mark.parametrize("mesh", MESHES)


def manifest(**changes):
    return ball_manifest(**{"intersections": 2.0, "max_distance": 3.0} | changes)


def built(cache, height):
    """The whole mesh for a height, without the cache."""
    facts = cache.manifest
    return build_mesh(facts.mesh_shape, height, facts.intersections, facts.max_distance, facts.mesh)


def assert_same_as_without(cache, orientation, lens, size):
    """The prepared part gives what the whole mesh gives, to the last digit, of all points that are answered."""
    view = cache.view(orientation, lens, size)
    prepared = project(view.mesh, view.rotation, lens, size)
    shown = prepared.answered
    mesh = built(cache, cache.mesh_height(orientation.height))
    answered = mesh if mesh.margin is None else mesh.part(np.flatnonzero(~mesh.margin))
    whole = project(answered, view.rotation, lens, size).visible
    np.testing.assert_array_equal(view.mesh.rays[shown], whole.graph.rays)
    np.testing.assert_array_equal(prepared.pixels[shown], whole.pixels)
    np.testing.assert_array_equal(view.mesh.part(shown).neighbors, whole.graph.neighbors)
    np.testing.assert_allclose(view.heading @ view.rotation, orientation.rotation, atol=1e-12)


@st.composite
def buckets(draw):
    """Settings, and the middle of a bucket: height, roll and pitch."""
    steps = draw(reals(1e-3, 0.6)), draw(reals(1e-3, 0.6))
    roll = round(draw(reals(-math.pi, math.pi)) / steps[0]) * steps[0]
    pitch = round(draw(reals(-1.0, 0.5 * math.pi)) / steps[1]) * steps[1]
    return Settings(roll_step=steps[0], pitch_step=steps[1]), draw(reals(0.3, 1.5)), roll, pitch


def within(bucket, random):
    """A random orientation of the bucket, often in its corners."""
    settings, height, roll, pitch = bucket
    away = 0.499 * np.sign(random.uniform(-1.0, 1.0, 2)) * random.random(2) ** 0.3
    pitch = min(max(pitch + away[1] * settings.pitch_step, -0.5 * math.pi), 0.5 * math.pi)
    yaw = random.uniform(-math.pi, math.pi)
    return Orientation.from_roll_pitch(height, roll + away[0] * settings.roll_step, pitch, yaw)


AHEAD = (Settings(), 0.8, 0.0, 0.4)


@in_all_layouts
@given(buckets(), lenses(), seeds)
@example(AHEAD, Equisolid(focal_length=100.0, fov=2.0 * math.pi), 0)
@example(AHEAD, Equidistant(focal_length=60.0, fov=2.0 * math.pi), 0)
def test_a_bucket_never_changes_an_answer(mesh, bucket, lens, seed):
    cache = MeshCache(manifest(mesh=mesh), bucket[0])
    random = np.random.default_rng(seed)
    for _ in range(6):
        assert_same_as_without(cache, within(bucket, random), lens, SIZE)
    assert cache.hits + cache.misses == 6


BROAD = (Settings(roll_step=0.5, pitch_step=0.5), 1.0, 0.0, 0.0)


@in_all_layouts
@given(buckets(), lenses(), seeds)
@example(BROAD, Equisolid(focal_length=127.0, fov=1.0, distortion=(-1e-6, 0.0)), 0)
def test_a_bucket_never_changes_an_answer_of_rotations_with_few_digits(mesh, bucket, lens, seed):
    """Matrices from files are rotations to some digits only; those that Orientation accepts are answered alike."""
    cache = MeshCache(manifest(mesh=mesh), bucket[0])
    random = np.random.default_rng(seed)
    for _ in range(6):
        exact = within(bucket, random)
        rough = Orientation(exact.height, exact.rotation + 2.8e-4 * random.uniform(-1.0, 1.0, (3, 3)))
        assert_same_as_without(cache, rough, lens, SIZE)


@in_all_layouts
@pytest.mark.parametrize("stretch", [1.0 - 4.9e-4, 1.0 + 4.9e-4])
@pytest.mark.parametrize("fov", [0.2, 0.8, 1.6])
def test_a_bucket_never_changes_an_answer_of_rotations_that_are_a_little_too_long_or_short(fov, stretch, mesh):
    fine = manifest(intersections=20.0, max_distance=1.5, mesh=mesh)
    cache = MeshCache(fine, Settings(pitch_step=1e-3, roll_step=1e-3))
    for pitch in (0.8, 1.0, 1.2):
        stretched = Orientation(0.8, stretch * Orientation.from_roll_pitch(0.8, pitch=pitch).rotation)
        assert_same_as_without(cache, stretched, Rectilinear(focal_length=400.0, fov=fov), SIZE)


@given(orientations(0.3, 1.5), lenses(), seeds)
def test_yaw_asks_for_nothing_new(orientation, lens, seed):
    cache = MeshCache(manifest(), Settings())
    random = np.random.default_rng(seed)
    first = cache.view(orientation, lens, SIZE)
    yaw = rotation([0.0, 0.0, random.uniform(-3.0, 3.0)])
    second = cache.view(Orientation(orientation.height, yaw @ orientation.rotation), lens, SIZE)
    np.testing.assert_allclose(second.rotation, first.rotation, atol=1e-9)
    np.testing.assert_allclose(second.heading, yaw @ first.heading, atol=1e-9)


@given(reals(0.2001, 50.0), reals(0.01, 2.0), reals(0.5, 12.0), st.sampled_from(["sphere", "circle"]))
def test_mesh_height_is_never_off_by_more_than_the_tolerance(height, tolerance, k, shape):
    """In rings across an object: k from the mesh's height is k + tolerance or less at the camera's, and back."""
    cache = MeshCache(manifest(intersections=k, shape=shape), Settings(height_tolerance=tolerance))
    found = cache.mesh_height(height)
    ratio = float(cache.shape.spacing(height) / cache.shape.spacing(found))
    assert abs(k * ratio - k) <= tolerance * (1.0 + 1e-9) + 1e-9
    assert abs(k / ratio - k) <= tolerance * (1.0 + 1e-9) + 1e-9


@given(reals(0.01, 1.0), seeds)
def test_heights_share_few_meshes(tolerance, seed):
    cache = MeshCache(manifest(), Settings(height_tolerance=tolerance))
    heights = np.random.default_rng(seed).uniform(0.5, 1.0, 200)
    found = {cache.mesh_height(height) for height in heights}
    spread = math.log(float(cache.shape.spacing(0.5) / cache.shape.spacing(1.0)))
    assert len(found) <= spread / (2.0 * math.log1p(tolerance / 2.0)) + 2
    assert all(cache.mesh_height(height) == pytest.approx(height, rel=1e-9) for height in found)


@in_all_layouts
@given(orientations(0.3, 1.5))
def test_without_tolerance_a_frame_has_its_own_height_rotation_and_heading(mesh, orientation):
    cache = MeshCache(manifest(mesh=mesh), Settings(height_tolerance=0.0))
    view = cache.view(orientation, LENS, SIZE)
    assert cache.mesh_height(orientation.height) == orientation.height
    np.testing.assert_array_equal(view.rotation, orientation.rotation)
    np.testing.assert_array_equal(view.heading, np.eye(3))
    assert_same_as_without(cache, orientation, LENS, SIZE)


@in_all_layouts
@pytest.mark.parametrize("tolerance", [0.0, 0.5])
def test_a_camera_that_looks_at_the_sky_has_no_points(tolerance, mesh):
    cache = MeshCache(manifest(mesh=mesh), Settings(height_tolerance=tolerance))
    lens = Rectilinear(focal_length=600.0, fov=1.2)
    view = cache.view(Orientation.from_roll_pitch(0.8, pitch=-1.2), lens, SIZE)
    assert len(view.mesh) == 0


@pytest.mark.parametrize("tolerance", [0.0, 0.5])
@pytest.mark.parametrize("height", [0.05, 0.1, 0.2])
def test_a_camera_below_the_top_of_the_ball_is_refused(tolerance, height):
    cache = MeshCache(manifest(), Settings(height_tolerance=tolerance))
    with pytest.raises(GeometryError, match="height"):
        cache.view(Orientation.from_roll_pitch(height, pitch=0.3), LENS, SIZE)
    assert cache.nbytes == 0


def test_hits_and_misses_are_counted():
    cache = MeshCache(manifest(), Settings())
    assert (cache.hits, cache.misses, cache.hit_rate, cache.nbytes) == (0, 0, 0.0, 0)
    ahead = Orientation.from_roll_pitch(0.8, pitch=0.4)
    down = Orientation.from_roll_pitch(0.8, pitch=1.2)
    for orientation, counts in ((ahead, (0, 1)), (ahead, (1, 1)), (down, (1, 2)), (ahead, (2, 2)), (down, (3, 2))):
        cache.view(orientation, LENS, SIZE)
        assert (cache.hits, cache.misses) == counts
    assert cache.hit_rate == 0.6
    cache.view(ahead, Equisolid(focal_length=301.0, fov=2.2), SIZE)
    assert cache.misses == 3
    cache.view(ahead, LENS, (320, 240))
    assert cache.misses == 4


@in_all_layouts
def test_a_hit_gives_the_same_layout(mesh):
    cache = MeshCache(manifest(mesh=mesh), Settings())
    ahead = Orientation.from_roll_pitch(0.8, pitch=0.4)
    assert cache.view(ahead, LENS, SIZE).layout is cache.view(ahead, LENS, SIZE).layout


@in_all_layouts
def test_nbytes_is_what_is_held(mesh):
    cache = MeshCache(manifest(mesh=mesh), Settings())
    first = cache.view(Orientation.from_roll_pitch(0.8, pitch=0.4), LENS, SIZE)
    whole = built(cache, cache.mesh_height(0.8))
    one = sum(each.nbytes for each in (first.mesh, first.layout, first.levels))
    assert cache.nbytes == whole.nbytes + one
    second = cache.view(Orientation.from_roll_pitch(0.8, pitch=1.2), LENS, SIZE)
    assert cache.nbytes == whole.nbytes + one + sum(each.nbytes for each in (second.mesh, second.layout, second.levels))


def test_the_least_recently_used_mesh_goes_first():
    low, middle, high = (Orientation.from_roll_pitch(height, pitch=0.4) for height in (0.5, 0.7, 0.9))
    free = MeshCache(manifest(), Settings(height_tolerance=0.0))
    sizes = [built(free, each.height).nbytes for each in (low, middle, high)]
    room_for_two = sum(sorted(sizes)[1:]) / 2**20
    cache = MeshCache(manifest(), Settings(height_tolerance=0.0, cache_mib=room_for_two))

    def is_hit(orientation):
        before = cache.hits
        cache.view(orientation, LENS, SIZE)
        return cache.hits > before

    assert [is_hit(each) for each in (low, middle, low, high, low, middle)] == [False, False, True, False, True, False]
    assert cache.nbytes == sizes[0] + sizes[1]


@in_all_layouts
@given(st.lists(st.integers(0, 5), min_size=1, max_size=20), reals(0.0, 0.6))
def test_the_memory_limit_is_obeyed_and_changes_no_answer(mesh, order, cache_mib):
    cache = MeshCache(manifest(mesh=mesh), Settings(cache_mib=cache_mib))
    free = MeshCache(manifest(mesh=mesh), Settings())
    for index in order:
        orientation = Orientation.from_roll_pitch(0.5 + 0.1 * (index % 3), pitch=0.3 + 0.2 * index)
        limited, unlimited = (each.view(orientation, LENS, SIZE) for each in (cache, free))
        assert cache.nbytes <= cache_mib * 2**20
        np.testing.assert_array_equal(limited.mesh.rays, unlimited.mesh.rays)
        np.testing.assert_array_equal(limited.mesh.neighbors, unlimited.mesh.neighbors)
    assert cache.hits + cache.misses == len(order)


def test_without_memory_nothing_is_held():
    cache = MeshCache(manifest(), Settings(cache_mib=0.0))
    orientation = Orientation.from_roll_pitch(0.8, pitch=0.4)
    for _ in range(3):
        assert len(cache.view(orientation, LENS, SIZE).mesh) > 0
    assert (cache.hits, cache.misses, cache.nbytes) == (0, 3, 0)


@given(seeds)
def test_a_camera_that_wanders_is_answered_right(seed):
    """Through many buckets with one cache, straight down and upside down included."""
    random = np.random.default_rng(seed)
    mesh = MESHES[seed % len(MESHES)]
    cache = MeshCache(manifest(max_distance=2.0, mesh=mesh), Settings(cache_mib=2.0))
    matrix = Orientation.from_roll_pitch(1.0, pitch=1.5).rotation
    for _ in range(5):
        matrix = matrix @ rotation(0.4 * random_direction(random))
        assert_same_as_without(cache, Orientation(random.uniform(0.3, 1.2), matrix), LENS, SIZE)


def touching(orientation, settings):
    """The middles of the bucket of an orientation and of the eight around it."""
    pitch, roll = round(orientation.pitch / settings.pitch_step), round(orientation.roll / settings.roll_step)
    return [
        Orientation.from_roll_pitch(
            orientation.height, (roll + lean) * settings.roll_step, (pitch + up) * settings.pitch_step
        )
        for up in (-1, 0, 1)
        for lean in (-1, 0, 1)
    ]


@given(reals(-0.5, 1.2), reals(-0.3, 0.3))
def test_all_buckets_that_touch_an_orientation_are_prepared_nearest_first(pitch, roll):
    cache = MeshCache(manifest(), Settings())
    orientation = Orientation.from_roll_pitch(0.8, roll, pitch)
    cache.view(orientation, LENS, SIZE)
    held = []
    while cache.prepare_nearby(orientation, LENS, SIZE):
        held.append(cache.nbytes)
    assert cache.prepared == len(held) == 8
    assert held == sorted(held)
    assert (cache.hits, cache.misses) == (0, 1)
    for beside in touching(orientation, cache.settings):
        assert_same_as_without(cache, beside, LENS, SIZE)
    assert (cache.hits, cache.misses) == (9, 1)


def test_the_bucket_that_the_camera_moves_to_is_prepared_first():
    cache = MeshCache(manifest(), Settings())
    cache.view(Orientation.from_roll_pitch(0.8, 0.0, 0.42), LENS, SIZE)  # 0.4 is the middle of its bucket
    cache.prepare_nearby(Orientation.from_roll_pitch(0.8, 0.0, 0.42), LENS, SIZE)
    cache.view(Orientation.from_roll_pitch(0.8, 0.0, 0.43), LENS, SIZE)
    assert (cache.hits, cache.misses) == (1, 1)


@given(reals(0.0, 2.0))
def test_preparing_drops_nothing(cache_mib):
    prepared, plain = (MeshCache(manifest(), Settings(cache_mib=cache_mib)) for _ in range(2))
    for pitch in (0.4, 0.4, 0.45, 0.4, 0.4, 0.35, 0.45, 0.4):
        orientation = Orientation.from_roll_pitch(0.8, 0.0, pitch)
        for cache in (prepared, plain):
            cache.view(orientation, LENS, SIZE)
        before = set(prepared._kept)
        prepared.prepare_nearby(orientation, LENS, SIZE)
        assert before <= set(prepared._kept)
        assert prepared.nbytes <= cache_mib * 2**20
    assert prepared.misses <= plain.misses


def test_nothing_is_prepared_without_tolerance():
    cache = MeshCache(manifest(), Settings(height_tolerance=0.0))
    assert not cache.prepare_nearby(Orientation.from_roll_pitch(0.8, 0.0, 0.4), LENS, SIZE)
