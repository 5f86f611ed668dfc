"""Field features of a frame: places and pixels agree, a turn of the camera turns them, and they can be switched off."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.drawn_scenes import FOLDER, IMAGES, MODEL
from vm_embedded import Detector, Orientation, Settings, read_lens_file
from vm_embedded.cameras.image_files import read_image
from vm_embedded.detection.field_points import ground_points, locate_features
from vm_embedded.detection.observation import Observation
from vm_embedded.network.manifest import ObjectClass

LENS = read_lens_file(FOLDER / "lens0000000.yaml").lens
IMAGE = read_image(IMAGES[0])
SOCCER = tuple(
    ObjectClass(name, kind)
    for name, kind in (("ball", "object"), ("line", "area"), ("field", "area"), ("environment", "background"))
)


@pytest.fixture(scope="module")
def detector():
    return Detector.from_file(MODEL)


@cache
def rays_of_pixels():
    """Rays (n, 3) in the camera frame through all pixels of the picture, row by row."""
    height, width = IMAGE.shape[:2]
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return LENS.for_image((width, height)).unproject(np.stack([x.ravel(), y.ravel()], axis=1), (width, height))


def ahead_of(rays, height):
    """How far ahead [m] rays (n, 3) of a level camera meet the plane; negative or huge without such a place."""
    return rays[:, 0] * height / np.maximum(-rays[:, 2], 1e-6)


def painted(detector: Detector, orientation: Orientation) -> Observation:
    """An observation of a field to 4 m ahead with a line across at 2 m, and a picture of this line."""
    ahead = ahead_of(rays_of_pixels() @ orientation.level.T, orientation.height).reshape(IMAGE.shape[:2])
    picture = np.where(np.abs(ahead - 2.0) < 0.03, 220, 90).astype(np.uint8)
    seen = detector.observe(np.repeat(picture[:, :, None], 3, axis=2), orientation, LENS)
    ahead = ahead_of(seen.mesh_rays, seen.view.height)
    label = np.where(ahead < 4.0, 2, 3)
    label[np.abs(ahead - 2.0) < 0.06] = 1
    probabilities = np.eye(4, dtype=np.float32)[label] * 0.9 + 0.025
    return replace(seen, manifest=replace(seen.manifest, classes=SOCCER), answers=probabilities)


@pytest.mark.long
@given(yaw=st.floats(-3.0, 3.0), roll=st.floats(-0.2, 0.2), pitch=st.floats(0.1, 0.6))
def test_places_on_the_plane_have_the_pixels_of_their_points(detector, yaw, roll, pitch):
    seen = painted(detector, Orientation.from_roll_pitch(0.8, roll, pitch, yaw))
    points = ground_points(seen)
    assert (np.diff(points.map.ranges) > -1e-6).all()
    on_screen = points.shown[points.map.numbers]
    places = points.height * points.heading @ points.map.places[:, on_screen]
    pixels = seen.view.picture_pixels(places.T)
    shown = np.isfinite(pixels).all(axis=1)
    assert shown.mean() > 0.99  # points beside the edge may round to its other side
    expected = seen.projected.pixels[points.map.numbers[on_screen]]
    assert pixels[shown] == pytest.approx(expected[shown], abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_a_painted_field_has_its_line_and_its_border(detector, yaw):
    found = locate_features(painted(detector, Orientation.from_roll_pitch(0.8, 0.0, 0.4, yaw)), {})
    away = np.array([np.cos(yaw), np.sin(yaw)])
    assert found.lines[0].ends @ away == pytest.approx([2.0, 2.0], abs=0.05)
    assert found.border.points @ away == pytest.approx(np.full(len(found.border.points), 4.0), abs=0.25)
    assert found.posts == found.robots == found.goals == ()
    assert found.circle is None
    assert len(found.line_points) == len(found.line_confidences) > 10


def test_a_network_without_classes_of_a_field_has_no_features(detector):
    seen = painted(detector, Orientation.from_roll_pitch(0.8, 0.0, 0.4))
    assert locate_features(replace(seen, manifest=replace(seen.manifest, classes=SOCCER[:1] + SOCCER[3:])), {}) is None


def test_they_can_be_switched_off(detector):
    frame = IMAGE, read_lens_file(FOLDER / "lens0000000.yaml").orientation, LENS
    assert detector.detect(*frame).field is not None
    quiet = Detector.from_file(MODEL, Settings(field_features=False)).detect(*frame)
    assert quiet.field is None
    assert "field" not in quiet.timing_ms


def test_a_point_without_a_probability_spoils_nothing_else(detector):
    seen = painted(detector, Orientation.from_roll_pitch(0.8, 0.0, 0.4))
    broken = seen.answers.copy()
    broken[:: len(broken) // 7] = np.nan
    found, whole = (locate_features(each, {}) for each in (replace(seen, answers=broken), seen))
    assert len(found.border.points) == len(whole.border.points)
    assert found.border.points == pytest.approx(whole.border.points, abs=0.2)
